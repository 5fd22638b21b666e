"""Robot and loop in lockstep: repeatable, armed from power-on, and without power when a part stops."""

from collections.abc import Iterator

import pytest

from control.controller import WalkOrder
from control.modes import Mode, Request
from control.rate import RATE_HZ
from control.records import JOINTS
from drivers.can.frames import Frame
from firmware_host.configuration.configuration import Configuration
from firmware_host.fault_texts import fault_message
from simulation.devices.drive import DriveError
from simulation.devices.motion_capture_parameters import MotionCaptureParameters
from simulation.harness.lockstep import Lockstep, drives_of, plant_of
from simulation.mud.clay import MUDS
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE
from tests.copied_robots import copy_of

TRACK = Track([(1.0, MUDS["48.5"])])


@pytest.fixture(scope="module")
def armed(configuration: Configuration) -> Lockstep:
    lockstep = Lockstep(configuration, TRACK)
    lockstep.arm()
    return lockstep


@pytest.fixture
def holding(armed: Lockstep) -> Lockstep:
    return copy_of(armed)


def make_walking(configuration: Configuration, seed: int, seconds: float) -> Lockstep:
    lockstep = Lockstep(configuration, TRACK, seed)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03))
    lockstep.run_for(seconds)
    return lockstep


def test_the_same_seed_walks_the_same_strides_to_the_last_bit(configuration: Configuration) -> None:
    first, second = (make_walking(configuration, 5, 2.0) for _ in range(2))
    assert len(first.loop.learning.strides) >= 2
    assert repr(first.loop.learning.strides) == repr(second.loop.learning.strides)
    assert repr(first.loop.states) == repr(second.loop.states)
    assert first.robot.plant.body_m == second.robot.plant.body_m


def test_another_seed_reads_other_currents(configuration: Configuration) -> None:
    first, second = (make_walking(configuration, seed, 0.1) for seed in (5, 6))
    currents = [[state.current_a for state in lockstep.loop.states] for lockstep in (first, second)]
    assert all(one != other for one, other in zip(*currents, strict=True))


def test_on_a_fixed_base_the_flippers_walk_and_the_body_stays(configuration: Configuration) -> None:
    lockstep = Lockstep(configuration, TRACK, fixed_base=True)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03))
    lockstep.run_for(2.0)
    assert len(lockstep.loop.learning.strides) >= 2
    assert lockstep.robot.plant.body_m == 0.0
    assert abs(lockstep.loop.body.x_m) < 0.001  # by motion capture


def test_a_plant_and_drives_of_one_s_own_are_used_as_they_are(configuration: Configuration) -> None:
    plant = plant_of(configuration, joint_coulomb_nm=0.01)
    drives = drives_of(configuration, cogging_nm=0.005, torque_constant_error=0.03)
    lockstep = Lockstep(configuration, TRACK, disturbances=LAB, plant=plant, drives=drives)
    assert lockstep.robot.plant.parameters is plant
    assert [drive.parameters for drive in lockstep.robot.drives] == [drives[joint] for joint in JOINTS]


def test_it_walks_with_everything_that_can_be_wrong_with_its_joints_and_its_pose(configuration: Configuration) -> None:
    drives = drives_of(
        configuration,
        torque_constant_error=-0.05,
        cogging_nm=0.01,
        current_lag_s=0.0005,
        current_noise_a=0.3,
        encoder_offset_rad=0.01,
        encoder_noise_rad=0.0002,
        message_delay_s=0.001,
        repeated_fraction=0.2,
    )
    cameras = MotionCaptureParameters(rate_hz=120.0, latency_s=0.01, dropouts_per_s=0.3)
    plant = plant_of(configuration, joint_coulomb_nm=0.01)
    lockstep = Lockstep(configuration, TRACK, plant=plant, drives=drives, motion_capture=cameras)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03))
    lockstep.run_for(4.0)
    assert lockstep.loop.fault is None
    assert len(lockstep.loop.learning.strides) >= 4
    assert lockstep.robot.plant.body_m > 0.1


def test_nothing_is_transmitted_before_every_drive_was_heard(configuration: Configuration) -> None:
    lockstep = Lockstep(configuration, TRACK)
    obeyed: list[Frame] = []
    for drive in lockstep.robot.drives:
        drive.receive = lambda frame, now_s: obeyed.append(frame) or []  # type: ignore[func-returns-value, method-assign]
    lockstep.run_until(lambda: lockstep.loop.mode is not Mode.BOOT, 1.0)
    assert lockstep.loop.mode is Mode.IDLE
    assert obeyed == []


def test_it_arms_from_power_on_and_holds_its_pose(holding: Lockstep) -> None:
    assert holding.now_s < 1.0
    before_rad = holding.robot.plant.angles_rad
    holding.run_for(1.5)
    assert holding.loop.mode is Mode.HOLD
    assert holding.loop.fault is None
    assert all(drive.energised for drive in holding.robot.drives)
    assert holding.robot.plant.angles_rad == pytest.approx(before_rad, abs=0.02)


def test_nothing_arms_by_itself(configuration: Configuration) -> None:
    lockstep = Lockstep(configuration, TRACK)
    lockstep.run_for(2.0)
    assert lockstep.loop.mode is Mode.IDLE
    assert all(not drive.energised for drive in lockstep.robot.drives)


def test_an_order_of_two_strides_walks_two_and_holds_with_flippers_raised(holding: Lockstep) -> None:
    holding.walk(WalkOrder(0.03, adaptive=False, strides=2))
    assert holding.run_until(lambda: holding.loop.mode is Mode.WALKING, 1.0)
    assert holding.run_until(lambda: holding.loop.mode is Mode.HOLD, 15.0)
    left = [stride.estimate.index for stride in holding.loop.learning.strides if stride.estimate.flipper == "left"]
    assert left == [0, 1]
    holding.run_for(0.5)
    geometry = holding.loop.configuration.geometry
    assert geometry.depth_m(*holding.robot.plant.angles_rad[:2]) < -0.005


def test_power_is_cut_when_the_loop_stops_ticking(holding: Lockstep) -> None:
    stopped_s = holding.now_s
    watchdog_s = holding.robot.drives[0].parameters.watchdog_s
    holding.robot.advance(stopped_s + 0.9 * watchdog_s)
    assert all(drive.energised for drive in holding.robot.drives)
    holding.robot.advance(stopped_s + 1.1 * watchdog_s)
    for drive in holding.robot.drives:
        assert not drive.energised and drive.failed
        assert drive.torque_nm(holding.robot.now_s) == 0.0


@pytest.fixture(scope="module")
def walking(configuration: Configuration) -> Lockstep:
    return make_walking(configuration, 1, 0.5)


@pytest.mark.parametrize("joint", JOINTS)
def test_a_silent_drive_is_a_fault_and_all_torques_are_zero(
    walking: Lockstep, monkeypatch: pytest.MonkeyPatch, joint: str
) -> None:
    lockstep = copy_of(walking)
    assert any(lockstep.loop.sent.torques_nm)

    def no_frames(now_s: float) -> Iterator[Frame]:
        return iter(())

    silent = JOINTS.index(joint)
    monkeypatch.setattr(lockstep.robot.drives[silent], "cyclic_frames", no_frames)
    assert lockstep.run_until(lambda: lockstep.loop.mode is Mode.FAULT, 0.1)
    assert lockstep.loop.fault is not None
    assert lockstep.loop.fault.name == "drive_silent"
    assert joint in fault_message(lockstep.loop.fault)
    assert lockstep.loop.sent.torques_nm == NO_TORQUE
    lockstep.step()
    assert all(not drive.energised for drive in lockstep.robot.drives)
    assert all(drive.torque_nm(lockstep.robot.now_s) == 0.0 for drive in lockstep.robot.drives)


def test_a_drive_that_disarms_itself_is_a_fault_that_can_be_cleared(holding: Lockstep) -> None:
    holding.robot.drives[2].trip(DriveError.WATCHDOG)
    assert holding.run_until(lambda: holding.loop.mode is Mode.FAULT, 0.2)
    assert holding.loop.fault is not None
    assert "right_sweep" in fault_message(holding.loop.fault)
    assert "watchdog expired" in fault_message(holding.loop.fault)
    holding.run_for(0.2)
    holding.loop.request(Request.CLEAR, holding.now_s)
    assert holding.run_until(lambda: holding.loop.mode is Mode.IDLE, 0.5)
    holding.arm()


def test_a_walk_hardly_depends_on_the_step_of_the_simulation(
    configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    coarse = make_walking(configuration, 1, 2.5).robot.plant.body_m
    monkeypatch.setattr("simulation.harness.robot.STEP_S", 0.00025)
    fine = make_walking(configuration, 1, 2.5).robot.plant.body_m
    assert coarse > 0.1
    assert fine == pytest.approx(coarse, rel=0.03)


@pytest.mark.parametrize("rate_hz", [200.0, RATE_HZ, 1000.0])
def test_a_walk_at_any_rate_ends_without_a_fault_or_a_refused_command(
    configuration: Configuration, rate_hz: float
) -> None:
    lockstep = Lockstep(configuration, TRACK, period_s=1.0 / rate_hz)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03, strides=1))
    faults: set[str] = set()
    while lockstep.now_s < 4.5:
        lockstep.step()
        faults.update(fault.name for fault in lockstep.loop.faults.present)
    assert lockstep.loop.mode is Mode.HOLD
    assert faults == set()
    assert lockstep.loop.drives.refused_commands == 0
    assert lockstep.loop.learning.strides_closed == 2
    assert lockstep.robot.plant.body_m > 0.05
