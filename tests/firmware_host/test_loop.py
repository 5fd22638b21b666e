"""The loop on simulated drives: requests, garbage on the bus, missed ticks, and the log."""

from dataclasses import replace
from itertools import pairwise

import pytest

from control.controller import WalkOrder
from control.faults import FaultKind
from control.modes import PREVENTED, Mode, Request
from control.rate import PERIOD_S
from control.records import Phase, same_for_all
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockPort
from drivers.odrive.codec import SET_INPUT_TORQUE
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.log.rows import STRIDE_KIND, TICK_KIND
from firmware_host.ticker import Tick
from simulation.devices.drive import DriveError
from simulation.harness.drive_presets import calibrated
from simulation.mud.clay import Clay
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE
from tests.copied_robots import copy_of
from tests.firmware_host.recorded_robot import RecordedRobot

WALKED_S = (0.0, 0.3, 0.9, 1.5, 1.7, 1.9, 2.1, 2.6)


@pytest.fixture(scope="module")
def walked(armed_robot: RecordedRobot) -> dict[float, RecordedRobot]:
    """Return copies of one robot in every phase, by the time since the request to walk."""
    robot, found = copy_of(armed_robot), {}
    robot.walk(WalkOrder(0.03))
    for before_s, after_s in pairwise((0.0, *WALKED_S)):
        robot.run_for(after_s - before_s)
        found[after_s] = copy_of(robot)
    return found


def torque_frames(port: MockPort) -> list[Frame]:
    return [frame for frame in port.receive() if frame.arbitration_id & 0x1F == SET_INPUT_TORQUE.command]


def test_nothing_is_transmitted_before_every_drive_was_heard(configuration: Configuration) -> None:
    robot = RecordedRobot(configuration)
    listeners = [bus.open() for bus in robot.buses.values()]
    robot.robot.advance = lambda until_s: None  # type: ignore[method-assign] # drives without power
    robot.run_for(1.0)
    assert robot.loop.request(Request.CLEAR, robot.now_s) is not None
    robot.step()
    assert robot.loop.mode is Mode.BOOT
    assert [listener.receive() for listener in listeners] == [[], []]


def test_arming_holds_the_pose_it_finds_without_a_jerk(configuration: Configuration) -> None:
    robot = RecordedRobot(configuration)
    robot.run_for(0.5)
    before = robot.robot.plant.angles_rad
    robot.arm()
    largest_nm = 0.0
    for _ in range(190):
        robot.step()
        largest_nm = max(largest_nm, *(abs(torque_nm) for torque_nm in robot.loop.sent.torques_nm))
    assert robot.loop.mode is Mode.HOLD
    assert robot.robot.plant.angles_rad == pytest.approx(before, abs=0.02)
    assert largest_nm < 0.1


def test_an_accepted_request_that_a_fault_of_the_next_tick_prevents_is_said(
    configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = RecordedRobot(configuration)
    assert robot.run_until(lambda: not robot.loop.faults.blocking() and robot.loop.mode is Mode.IDLE, 3.0)
    assert robot.loop.request(Request.ARM, robot.now_s) is None
    with monkeypatch.context() as patch:
        patch.setattr(robot.loop.fault_monitor, "update", lambda *_: [FaultKind.JOINT_MOVING.fault("left_sweep")])
        robot.step()
    notice = robot.loop.events.notice
    assert notice.startswith(f"arm {PREVENTED}") and "left_sweep" in notice
    assert robot.run_until(lambda: not robot.loop.faults.blocking(), 3.0)
    assert robot.loop.request(Request.ARM, robot.now_s) is None
    assert robot.loop.events.notice == ""
    robot.step()
    assert robot.loop.mode is Mode.ARMING


@pytest.mark.parametrize("walked_s", WALKED_S[2:])
def test_stop_raises_the_flippers_from_any_phase(walked: dict[float, RecordedRobot], walked_s: float) -> None:
    robot = copy_of(walked[walked_s])
    robot.loop.request(Request.STOP, robot.now_s)
    assert robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 3.0)
    robot.run_for(0.3)
    assert robot.robot.plant.angles_rad[1] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("walked_s", WALKED_S)
def test_disarm_ends_torque_at_once_in_every_phase(walked: dict[float, RecordedRobot], walked_s: float) -> None:
    robot = copy_of(walked[walked_s])
    robot.loop.request(Request.DISARM, robot.now_s)
    robot.step()
    assert robot.loop.mode is Mode.IDLE
    assert robot.loop.sent.torques_nm == NO_TORQUE
    robot.run_for(0.02)
    assert not any(robot.energised)


@pytest.mark.parametrize(("is_asked", "within_s"), [(True, 0.01), (False, 0.18)])
def test_a_drive_that_runs_is_idled_before_all_are_heard_and_at_once_on_request(
    configuration: Configuration, is_asked: bool, within_s: float
) -> None:
    """This happens if the daemon restarts while one motor runs and another drive is dead."""
    robot = RecordedRobot(configuration)
    running = robot.robot.drives[0]
    running.energised = True
    robot.robot.drives = same_for_all(running)
    robot.run_for(0.02)
    assert robot.loop.mode is Mode.BOOT
    if is_asked:
        assert robot.loop.request(Request.DISARM, robot.now_s) is None
    robot.run_for(within_s)
    assert robot.loop.mode is Mode.BOOT and not running.energised


def test_a_stalled_loop_idles_the_drives(walked: dict[float, RecordedRobot]) -> None:
    robot = copy_of(walked[1.7])
    robot.stall(199)
    robot.step()
    assert robot.loop.mode is Mode.FAULT
    assert "loop_stalled" in robot.fault_names
    assert robot.loop.sent.torques_nm == NO_TORQUE


@pytest.mark.parametrize(("ticks", "leave"), [(0, True), (9, True), (11, False), (400, False)])
def test_torques_of_a_tick_that_was_interrupted_do_not_leave(robot: RecordedRobot, ticks: int, leave: bool) -> None:
    """A stopped process continues within its tick; a drive whose watchdog does not latch would follow old torques."""
    port = robot.buses["left"].open()
    robot.tick_number += 1
    robot.robot.advance(robot.now_s)
    tick = Tick(robot.now_s, 0.0, robot.tick_number, 0)
    robot.tick_number += ticks
    robot.loop.tick(tick)
    assert bool(torque_frames(port)) is leave
    assert (robot.loop.sent.torques_nm != NO_TORQUE) is leave


def test_the_slew_limit_does_not_grow_with_missed_ticks(walked: dict[float, RecordedRobot]) -> None:
    robot = copy_of(walked[1.7])
    before_nm = robot.loop.sent.torques_nm
    robot.stall(7)
    robot.step()
    largest_nm = robot.loop.configuration.limits.torque_rate_nm_s * PERIOD_S
    for before, after in zip(before_nm, robot.loop.sent.torques_nm, strict=True):
        assert abs(after - before) <= largest_nm + 1e-12


def test_flippers_that_stay_in_the_mud_are_reported(configuration: Configuration) -> None:
    robot = RecordedRobot(configuration, Clay("3 kPa", 3000.0))
    robot.arm()
    robot.walk(WalkOrder(0.05, False))
    robot.run_until(lambda: robot.loop.target.phase is Phase.STANCE, 5.0)
    for arm in robot.robot.plant.arms:
        arm.track = Track([(5.0, Clay("9 kPa", 9000.0))])
    robot.loop.request(Request.STOP, robot.now_s)
    assert robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 5.0)
    assert robot.loop.events.notice == "the flippers did not come out of the mud"


def test_a_torque_that_is_not_finite_is_never_sent(robot: RecordedRobot) -> None:
    robot.loop.controller.gains = replace(robot.loop.controller.gains, sweep_stiffness_nm_rad=float("nan"))
    listener = robot.buses["left"].open()
    robot.run_for(0.1)
    assert robot.loop.mode is Mode.FAULT
    assert robot.loop.fault is not None and robot.loop.fault.name == "torque_not_finite"
    for frame in torque_frames(listener):
        (torque_nm,) = SET_INPUT_TORQUE.decode(frame.data)
        assert torque_nm == torque_nm


def test_a_lease_that_is_lost_ends_with_the_torque(robot: RecordedRobot) -> None:
    """It stays lost while torque is on; then another program may take it."""
    lease = robot.loop.lease
    lease.renew("anna", robot.now_s, 0.1)
    robot.run_for(0.2)
    assert robot.loop.mode is not Mode.IDLE and lease.refusal("ben", robot.now_s) is not None
    robot.loop.request(Request.DISARM, robot.now_s)
    robot.run_for(0.02)
    assert lease.holder is None
    assert lease.renew("ben", robot.now_s, 0.1) is None
    robot.run_for(0.2)
    assert lease.holder is None
    assert "lease of ben is over" in robot.recorder.texts


def test_no_torque_is_sent_in_a_mode_without_whatever_the_controller_wants(robot: RecordedRobot) -> None:
    wanted_nm = same_for_all(0.05)
    robot.loop.controller.step = lambda *arguments: wanted_nm  # type: ignore[method-assign]
    robot.step()
    assert robot.loop.sent.torques_nm == wanted_nm
    robot.loop.request(Request.DISARM, robot.now_s)
    for mode in (Mode.IDLE, Mode.ARMING):
        robot.step()
        assert (robot.loop.mode, robot.loop.sent.torques_nm) == (mode, NO_TORQUE)
        robot.run_for(0.02)
        robot.loop.request(Request.ARM, robot.now_s)


def test_garbage_on_the_bus_is_counted_and_changes_nothing(configuration: Configuration) -> None:
    quiet, noisy = RecordedRobot(configuration), RecordedRobot(configuration)
    garbage = noisy.buses["left"].open()
    for robot in (quiet, noisy):
        robot.arm()
        robot.walk(WalkOrder(0.03))
    for number in range(750):
        quiet.step()
        garbage.send(Frame(0x700 | number % 224, bytes(number % 9)))  # 0x7E0 and above address every drive
        garbage.send(Frame(0x009, b"\x00\x00\xc0\x7f\x00\x00\x00\x00"))  # a known drive that reports NaN
        garbage.send(Frame(0x029, b"\x01"))
        noisy.step()
    assert noisy.loop.drives.unknown_frames >= 750 and noisy.loop.drives.malformed_frames >= 1500
    assert len(quiet.loop.learning.strides) >= 2
    assert repr(noisy.loop.learning.strides) == repr(quiet.loop.learning.strides)  # NaN is not equal to NaN


def test_the_gait_advances_by_the_missed_ticks(robot: RecordedRobot) -> None:
    robot.walk(WalkOrder(0.03))
    robot.run_until(lambda: robot.loop.target.stride == 0, 5.0)
    robot.run_for(0.2)
    before = robot.loop.controller.gait._time_s
    robot.stall(2)
    robot.step()
    assert robot.loop.controller.gait._time_s - before == pytest.approx(3 * PERIOD_S)


def test_every_tick_and_every_stride_is_recorded(robot: RecordedRobot) -> None:
    robot.walk(WalkOrder(0.03, True, 1))
    robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 10.0)
    kinds = robot.recorder.kinds
    assert kinds.count(TICK_KIND) == robot.tick_number
    assert kinds.count(STRIDE_KIND) == robot.loop.learning.strides_closed == 2
    assert "request walk" in robot.recorder.texts
    assert "mode hold to walking" in robot.recorder.texts


def test_a_stop_does_not_cancel_a_clear_that_waits_for_the_drives(robot: RecordedRobot) -> None:
    robot.robot.drives[0].trip(DriveError.WATCHDOG)
    assert robot.run_until(lambda: robot.loop.mode is Mode.FAULT, 0.2)
    robot.loop.request(Request.CLEAR, robot.now_s)
    robot.step()
    robot.loop.request(Request.STOP, robot.now_s)
    assert robot.run_until(lambda: robot.loop.mode is Mode.IDLE, 0.6)


def test_four_drives_on_one_bus_walk_as_well(example_text: str) -> None:
    text = calibrated(example_text.replace('bus = "right"', 'bus = "left"'))
    robot = RecordedRobot(parse_configuration(text))
    robot.arm()
    robot.walk(WalkOrder(0.03, True, 1))
    assert robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 10.0)
    assert robot.robot.plant.body_m > 0.07
