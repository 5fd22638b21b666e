"""In lockstep injected failures are the same every time, are logged, and are over when the robot is put right."""

import pytest

from control.controller import WalkOrder
from control.modes import Mode, Request
from control.records import Phase
from drivers.can.mock_bus import MockPort
from drivers.fault_injection.failures import Failures
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.body.plant import END_STOPS_RAD
from simulation.devices.motion_capture import SimulatedPose
from simulation.harness.drive_presets import with_drive_type
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.copied_robots import copy_of

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


def test_a_stalled_loop_misses_ticks_while_the_robot_continues(lockstep: Lockstep) -> None:
    ticks = lockstep.tick_number
    lockstep.fail("loop", "stuck")
    lockstep.step()
    assert lockstep.loop.missed_ticks == lockstep.tick_number - ticks - 1 == 11


@pytest.mark.parametrize("drive", ["moteus", "mit"])
def test_answers_that_are_late_are_not_those_of_a_second_drive(example_text: str, drive: str) -> None:
    configuration = parse_configuration(with_drive_type(example_text, drive))
    lockstep = Lockstep(configuration, TRACK, failures=Failures(configuration.bus))
    lockstep.arm(forced="uncalibrated")
    lockstep.fail("left_sweep", "slow", 1.0)
    seen: set[str] = set()
    for _ in range(400):
        lockstep.step()
        seen |= {fault.name for fault in lockstep.loop.faults.present}
    assert "drive_late" in seen and "duplicate_node_id" not in seen


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
            for zero in lockstep.loop.fault_monitor.zeros:
                zero.confirm()  # the drives were silent while the joints moved
        lockstep.loop.request(Request.CLEAR, lockstep.now_s)
        lockstep.run_for(0.6)
        beyond = [fault.subject for fault in lockstep.loop.faults.present if fault.name == "joint_position"]
        assert beyond == ([] if by_hand else ["left_sweep", "left_adduction"])
    lockstep.arm()
    assert lockstep.loop.mode is Mode.HOLD


def test_without_failures_nothing_is_wrapped_and_none_that_is_unknown_can_begin(configuration: Configuration) -> None:
    plain = Lockstep(configuration, TRACK)
    assert {type(port) for port in plain.loop.drives.ports.values()} == {MockPort}
    assert type(plain.loop.pose) is SimulatedPose
    watched = Lockstep(configuration, TRACK, failures=Failures(configuration.bus))
    for lockstep, component in ((plain, "left_sweep"), (watched, "left_knee")):
        with pytest.raises(RuntimeError):
            lockstep.fail(component, "off")
        lockstep.run_for(0.2)
    assert repr(plain.loop.states) == repr(watched.loop.states)  # failures that never begin change nothing
