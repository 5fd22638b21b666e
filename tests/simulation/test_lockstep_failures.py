"""In lockstep the loop handles injected failures without an exception, and in the same way every time."""

from __future__ import annotations

import pytest

from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from control.records import Phase
from drivers.fault_injection.failures import Failures
from firmware_host.configuration.configuration import Configuration
from simulation.body.plant import END_STOPS_RAD
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE
from tests.copied_robots import copy_of
from tests.recorded_events import EventRecorder

TRACK = Track([(2.0, MUDS["48.5"])])


@pytest.fixture(scope="module")
def sound(configuration: Configuration) -> Lockstep:
    """Return a robot that walks without a failure."""
    lockstep = Lockstep(configuration, TRACK, failures=Failures(configuration.bus))
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03))
    lockstep.run_for(0.5)
    return lockstep


@pytest.fixture
def lockstep(sound: Lockstep) -> Lockstep:
    return copy_of(sound)


@pytest.mark.parametrize(
    ("component", "kind", "fault"),
    [
        ("left_sweep", "off", "drive_silent"),
        ("right_adduction.error", "off", "drive_disarmed"),
        ("right_adduction.error", "stuck", "drive_error"),
        ("left_sweep.command", "off", "drive_error"),  # its watchdog trips
        ("bus.right", "stuck", "bus_refuses"),
        ("loop", "stuck", "loop_stalled"),
    ],
)
def test_each_failure_shows_as_the_fault_that_it_is(lockstep: Lockstep, component: str, kind: str, fault: str) -> None:
    lockstep.fail(component, kind)
    reported = set()
    for _ in range(114):
        lockstep.step()
        reported |= {standing.name for standing in lockstep.loop.faults.present}
    assert fault in reported
    assert lockstep.loop.fault is not None


def test_no_failure_brings_an_exception_out_of_the_loop_nor_torque_without_power(
    configuration: Configuration, lockstep: Lockstep
) -> None:
    limit_nm = configuration.limits.torque_nm
    for component, kind, _ in list(lockstep.failures.table()):
        lockstep.fail(component, kind, 0.05)
        for _ in range(25):
            lockstep.step()
            torques_nm = lockstep.loop.sent.torques_nm
            assert max(map(abs, torques_nm)) <= limit_nm + 1e-9
            assert lockstep.loop.mode in ENERGISED or torques_nm == NO_TORQUE
    lockstep.run_for(0.1)
    assert not lockstep.failures.failing


def test_the_same_failure_is_the_same_to_the_last_bit(sound: Lockstep) -> None:
    first, second = copy_of(sound), copy_of(sound)
    for lockstep in (first, second):
        lockstep.fail("left_sweep", "intermittent", 0.3)
        lockstep.fail("right_sweep.current", "garbage", 0.3)
        lockstep.run_for(0.5)
    assert repr(first.loop.states) == repr(second.loop.states)
    assert first.robot.plant.body_m == second.robot.plant.body_m


def test_begin_and_end_stand_in_the_log(configuration: Configuration) -> None:
    recorder = EventRecorder()
    lockstep = Lockstep(configuration, TRACK, recorder=recorder, failures=Failures(configuration.bus))
    lockstep.fail("pose", "off", 0.1)
    lockstep.run_for(0.2)
    assert [text for text in recorder.texts if "on purpose" in text] == [
        "failing on purpose: pose off for 0.1 s, asked by lockstep",
        "end of failing on purpose: pose off",
    ]


def test_a_stalled_loop_misses_ticks_while_the_robot_continues(lockstep: Lockstep) -> None:
    ticks = lockstep.tick_number
    lockstep.fail("loop", "stuck")
    lockstep.step()
    assert lockstep.loop.missed_ticks == lockstep.tick_number - ticks - 1 == 11


def test_joints_at_their_stops_are_moved_back_by_hand_and_the_robot_arms_again(lockstep: Lockstep) -> None:
    """The bus fails in an extraction; each drive keeps its last torque until its watchdog trips."""
    lockstep.run_until(lambda: lockstep.loop.target.phase is Phase.EXTRACTION, 5.0)
    lockstep.run_for(0.02)
    lockstep.fail("bus.left", "bus-off", 0.5)
    lockstep.run_for(1.0)
    arms = lockstep.robot.plant.arms
    assert (abs(arms[0].sweep_rad), abs(arms[0].adduction_rad)) == END_STOPS_RAD
    for by_hand in (False, True):
        if by_hand:
            lockstep.robot.request_put_back()
            lockstep.run_for(0.5)
        lockstep.loop.request(Request.CLEAR, lockstep.now_s)
        lockstep.run_for(0.6)
        beyond = [fault.subject for fault in lockstep.loop.faults.present if fault.name == "joint_position"]
        assert beyond == ([] if by_hand else ["left_sweep", "left_adduction"])
    lockstep.arm()
    assert lockstep.loop.mode is Mode.HOLD


def test_an_unknown_component_cannot_fail(configuration: Configuration) -> None:
    lockstep = Lockstep(configuration, TRACK, failures=Failures(configuration.bus))
    with pytest.raises(RuntimeError, match="--list"):
        lockstep.fail("left_knee", "off")


def test_without_failures_nothing_is_wrapped_and_none_can_begin(configuration: Configuration) -> None:
    lockstep = Lockstep(configuration, TRACK)
    assert {type(port).__name__ for port in lockstep.loop.drives.ports.values()} == {"MockPort"}
    assert type(lockstep.loop.pose).__name__ == "SimulatedPose"
    with pytest.raises(RuntimeError, match="no failures"):
        lockstep.fail("left_sweep", "off")


def test_failures_that_never_begin_change_nothing(configuration: Configuration) -> None:
    sound = Lockstep(configuration, TRACK)
    watched = Lockstep(configuration, TRACK, failures=Failures(configuration.bus))
    for lockstep in (sound, watched):
        lockstep.arm()
        lockstep.run_for(0.2)
    assert repr(sound.loop.states) == repr(watched.loop.states)
