"""The whole program in muds that hold the flippers: when it recovers by itself, and how it stops when it cannot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from control.controller import DAMPING_S, WalkOrder
from control.gait.gait import stride_duration_s
from control.gait.recovery import RecoveryParameters
from control.modes import Mode, Request
from control.rate import PERIOD_S
from control.records import NO_TORQUE, Phase
from drivers.can.frames import Frame
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from firmware_host.log_reading.replay import replay_files
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.track import Track
from tests.recorded_events import EventRecorder

PARAMETERS = RecoveryParameters()
HASTY = RecoveryParameters(attempts=2, pause_s=0.1, attempt_s=0.6)


def longest_s(parameters: RecoveryParameters) -> float:
    return parameters.attempts * (parameters.pause_s + parameters.attempt_s)


def mud(kilopascal: float) -> Track:
    return Track([(3.0, Clay(f"{kilopascal:g} kPa", 1e3 * kilopascal))])


def walking(configuration: Configuration, track: Track, depth_m: float) -> tuple[Lockstep, EventRecorder]:
    recorder = EventRecorder()
    robot = Lockstep(configuration, track, recorder=recorder)
    robot.arm()
    robot.walk(WalkOrder(depth_m, adaptive=False))
    assert until_phase(robot, Phase.INSERTION)
    return robot, recorder


def until_phase(robot: Lockstep, phase: Phase) -> bool:
    return robot.run_until(lambda: robot.loop.target.phase is phase, 10.0)


def until_swing(robot: Lockstep) -> bool:
    return robot.run_until(lambda: robot.loop.target.phase is Phase.SWING, longest_s(PARAMETERS) + 5.0)


def recovering(configuration: Configuration, held_kilopascal: float = 40.0) -> tuple[Lockstep, EventRecorder]:
    """In mud that hardens round the flippers while they are in it, with little patience."""
    robot, recorder = walking(replace(configuration, recovery=HASTY), mud(2.6), 0.04)
    assert until_phase(robot, Phase.STANCE)
    for arm in robot.robot.plant.arms:
        arm.track = mud(held_kilopascal)
    assert until_phase(robot, Phase.RECOVERY)
    return robot, recorder


@pytest.mark.parametrize(("kilopascal", "depth_m"), [(0.5, 0.05), (2.6, 0.03), (4.5, 0.03)])
def test_in_the_muds_of_the_paper_nothing_is_recovered(
    configuration: Configuration, kilopascal: float, depth_m: float
) -> None:
    robot, recorder = walking(configuration, mud(kilopascal), depth_m)
    robot.run_for(3.5 * stride_duration_s(configuration.gait, configuration.geometry, depth_m))
    assert len(robot.loop.learning.strides) >= 6
    assert recorder.about("stuck") == []
    assert all(stride.estimate.released for stride in robot.loop.learning.strides)


def test_where_flippers_come_out_in_time_no_tick_is_waited(configuration: Configuration) -> None:
    paper, _ = walking(replace(configuration, recovery=RecoveryParameters(attempts=0)), mud(2.6), 0.03)
    robot, _ = walking(configuration, mud(2.6), 0.03)
    for each in (paper, robot):
        each.run_for(5.0)
    assert robot.robot.plant.body_m == paper.robot.plant.body_m > 0.2
    assert robot.robot.plant.angles_rad == paper.robot.plant.angles_rad
    assert repr(robot.loop.learning.strides) == repr(paper.loop.learning.strides)


def test_without_attempts_swing_begins_with_the_flippers_in_the_mud(configuration: Configuration) -> None:
    """The paper's extraction failure: nothing waits."""
    robot, recorder = walking(replace(configuration, recovery=RecoveryParameters(attempts=0)), mud(7.5), 0.05)
    start_s = robot.now_s
    assert robot.run_until(lambda: robot.loop.target.stride == 2, 10.0)
    stride_s = stride_duration_s(configuration.gait, configuration.geometry, 0.05)
    assert robot.now_s - start_s == pytest.approx(2.0 * stride_s, abs=2.0 * PERIOD_S)
    assert recorder.about("stuck") == []
    assert not any(stride.estimate.released for stride in robot.loop.learning.strides)


@pytest.mark.parametrize("kilopascal", [6.0, 7.5, 9.0])
def test_in_stiff_mud_it_frees_itself_and_walks_on(configuration: Configuration, kilopascal: float) -> None:
    """And the body goes forward meanwhile, by at least half of a stride's 12 cm."""
    robot, recorder = walking(configuration, mud(kilopascal), 0.05)
    assert until_phase(robot, Phase.RECOVERY)
    stuck_s, stuck_m = robot.now_s, robot.robot.plant.body_m
    assert until_swing(robot)
    assert robot.now_s - stuck_s < longest_s(PARAMETERS)
    assert robot.robot.plant.body_m > stuck_m + 0.06
    assert recorder.texts[-1].startswith("the flippers came out after")
    assert [stride.estimate.released for stride in robot.loop.learning.strides] == [False, False]
    assert until_phase(robot, Phase.INSERTION)
    assert robot.loop.mode is Mode.WALKING
    geometry = configuration.geometry
    assert geometry.depth_m(*robot.robot.plant.angles_rad[:2]) == pytest.approx(-geometry.clearance_m, abs=0.002)


def test_it_walks_further_than_one_that_does_not_wait(configuration: Configuration) -> None:
    advances_m = []
    for attempts in (0, 3):
        recovery = RecoveryParameters(attempts)
        robot, _ = walking(replace(configuration, recovery=recovery), mud(5.0), 0.05)
        robot.run_for(8.0)
        advances_m.append(robot.robot.plant.body_m)
    assert advances_m[1] > 2.0 * advances_m[0]


def test_one_flipper_alone_is_named_and_its_stride_alone_was_not_released(configuration: Configuration) -> None:
    robot, recorder = walking(configuration, mud(2.6), 0.05)
    robot.robot.plant.arms[1].track = mud(6.0)
    assert until_swing(robot)
    assert recorder.about("stuck")[0] == "the right flipper is stuck, attempt 1 of 3"
    released = {stride.estimate.flipper: stride.estimate.released for stride in robot.loop.learning.strides}
    assert released == {"left": True, "right": False}


def test_mud_that_lets_nothing_go_ends_in_a_fault_without_torque_in_bounded_time(configuration: Configuration) -> None:
    robot, recorder = recovering(configuration)
    began_s = robot.now_s
    assert robot.run_until(lambda: robot.loop.mode is Mode.DAMPING, 2.0)
    assert robot.now_s - began_s == pytest.approx(longest_s(HASTY), abs=5.0 * PERIOD_S)
    assert robot.run_until(lambda: robot.loop.mode is Mode.FAULT, DAMPING_S + PERIOD_S)
    assert len(recorder.about(" stuck, attempt ")) == HASTY.attempts
    assert robot.loop.fault is not None
    assert robot.loop.fault.name == "flipper_stuck"
    assert robot.loop.sent.torques_nm == NO_TORQUE
    robot.step()
    assert all(not drive.energised for drive in robot.robot.drives)
    robot.run_for(0.5)
    assert robot.loop.mode is Mode.FAULT  # latched until an operator clears it
    assert robot.loop.request(Request.ARM, robot.now_s) is not None
    assert robot.loop.request(Request.CLEAR, robot.now_s) is None
    assert robot.run_until(lambda: robot.loop.mode is Mode.IDLE, 1.0)
    assert robot.loop.fault is None
    robot.arm()


def test_a_drive_that_goes_silent_in_a_recovery_is_the_fault_of_that_moment(
    configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, _ = recovering(configuration)

    def no_frames(now_s: float) -> Iterator[Frame]:
        return iter(())

    monkeypatch.setattr(robot.robot.drives[1], "cyclic_frames", no_frames)
    assert robot.run_until(lambda: robot.loop.mode is Mode.FAULT, 0.1)
    assert robot.loop.fault is not None
    assert robot.loop.fault.name == "drive_silent"


def test_a_stop_in_a_recovery_is_obeyed(configuration: Configuration) -> None:
    robot, _ = recovering(configuration)
    assert robot.loop.request(Request.STOP, robot.now_s) is None
    assert robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 5.0)
    assert robot.loop.events.notice == "the flippers did not come out of the mud"


def test_targets_stay_within_the_joints_limits_and_torque_within_its_own(configuration: Configuration) -> None:
    robot, _ = recovering(configuration, 9.0)
    limits = configuration.limits
    while robot.loop.mode is Mode.WALKING and robot.loop.target.phase is not Phase.INSERTION:
        robot.step()
        assert all(abs(torque_nm) <= limits.torque_nm for torque_nm in robot.loop.sent.torques_nm)
        for state, span in zip(robot.loop.states, configuration.joint_ranges, strict=True):
            assert span.min_rad - 0.02 < state.angle_rad < span.max_rad + 0.02


def test_a_replayed_walk_with_recoveries_gives_the_same_strides_to_the_last_digit(
    tmp_path: Path, configuration: Configuration
) -> None:
    path = tmp_path / "walk.mcap"
    recorder = Recorder(path, configuration.text, {"robot": "test"})
    robot = Lockstep(configuration, mud(6.0), recorder=recorder)
    robot.arm()
    robot.walk(WalkOrder(0.04, False, 1))
    assert robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 20.0)
    assert recorder.close(20.0)
    live = [stride.estimate for stride in robot.loop.learning.strides]
    assert [stride.released for stride in live] == [False] * 2
    assert repr(replay_files([path]).strides) == repr(live)
