"""In muds that hold the flippers the whole program recovers by itself, or stops safely if it cannot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from control.controller import DAMPING_S, WalkOrder
from control.gait.gait import stride_duration_s
from control.modes import Mode, Request
from control.parameters.recovery_parameters import RecoveryParameters
from control.rate import PERIOD_S
from control.records import Phase
from drivers.can.frames import Frame
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from logs.replay import replay_files
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE
from tests.copied_robots import copy_of
from tests.recorded_events import EventRecorder

PARAMETERS = RecoveryParameters()
HASTY = RecoveryParameters(attempts=2, pause_s=0.1, attempt_s=0.6)
NEVER = RecoveryParameters(attempts=0)


def longest_s(parameters: RecoveryParameters) -> float:
    return parameters.attempts * (parameters.pause_s + parameters.attempt_s)


def mud(kilopascal: float) -> Track:
    return Track([(3.0, Clay(f"{kilopascal:g} kPa", 1e3 * kilopascal))])


def walking(
    configuration: Configuration, track: Track, depth_m: float, log: Recorder | None = None
) -> tuple[Lockstep, EventRecorder]:
    recorder = EventRecorder(log)
    robot = Lockstep(configuration, track, recorder=recorder)
    robot.arm()
    robot.walk(WalkOrder(depth_m, adaptive=False))
    assert until_phase(robot, Phase.INSERTION)
    return robot, recorder


def faults_since_arming(recorder: EventRecorder) -> list[str]:
    texts = recorder.texts
    return [text for text in texts[texts.index("request arm") :] if text.startswith("fault ")]


def until_phase(robot: Lockstep, phase: Phase) -> bool:
    return robot.run_until(lambda: robot.loop.target.phase is phase, 10.0)


def until_swing(robot: Lockstep) -> bool:
    return robot.run_until(lambda: robot.loop.target.phase is Phase.SWING, longest_s(PARAMETERS) + 5.0)


def until_closed(robot: Lockstep) -> bool:
    """Run the ticks over which the work of a stride is spread."""
    return robot.run_until(lambda: len(robot.loop.learning.strides) == 2, 50.0 * PERIOD_S)


@pytest.fixture(scope="module")
def in_stance(configuration: Configuration) -> Lockstep:
    """Return a robot with short recoveries and with its flippers inserted in mud that releases them."""
    robot, _ = walking(replace(configuration, recovery=HASTY), mud(2.6), 0.04)
    assert until_phase(robot, Phase.STANCE)
    return robot


def hardened(in_stance: Lockstep, kilopascal: float) -> Lockstep:
    """Return the same robot in a recovery, after the mud has hardened around its flippers."""
    robot = copy_of(in_stance)
    for arm in robot.robot.plant.arms:
        arm.track = mud(kilopascal)
    assert until_phase(robot, Phase.RECOVERY)
    return robot


@pytest.fixture(scope="module")
def held(in_stance: Lockstep) -> Lockstep:
    return hardened(in_stance, 40.0)


@pytest.fixture
def recovering(held: Lockstep) -> Lockstep:
    """Return a robot in a recovery, in mud that never releases its flippers."""
    return copy_of(held)


@pytest.fixture(scope="module")
def two_strides(configuration: Configuration) -> Callable[[float, float], tuple[Lockstep, EventRecorder]]:
    """Return a function that walks two strides in mud of a strength and at a depth; results are cached."""

    @cache
    def walk(kilopascal: float, depth_m: float) -> tuple[Lockstep, EventRecorder]:
        robot, recorder = walking(configuration, mud(kilopascal), depth_m)
        assert robot.run_until(lambda: len(robot.loop.learning.strides) == 4, 6.0)
        return robot, recorder

    return walk


TwoStrides = Callable[[float, float], tuple[Lockstep, EventRecorder]]


@pytest.mark.parametrize(("kilopascal", "depth_m"), [(0.5, 0.05), (2.6, 0.03), (4.5, 0.03)])
def test_in_the_muds_of_the_paper_nothing_is_recovered_and_nothing_is_a_fault(
    two_strides: TwoStrides, kilopascal: float, depth_m: float
) -> None:
    robot, recorder = two_strides(kilopascal, depth_m)
    assert recorder.about("stuck") == faults_since_arming(recorder) == []
    assert all(stride.estimate.released for stride in robot.loop.learning.strides)


def test_if_flippers_come_out_in_time_the_gait_does_not_wait(
    configuration: Configuration, two_strides: TwoStrides
) -> None:
    robot, _ = two_strides(2.6, 0.03)
    paper, _ = walking(replace(configuration, recovery=NEVER), mud(2.6), 0.03)
    paper.run_for(robot.now_s - paper.now_s)
    assert robot.robot.plant.body_m == paper.robot.plant.body_m > 0.1
    assert robot.robot.plant.angles_rad == paper.robot.plant.angles_rad
    assert repr(robot.loop.learning.strides) == repr(paper.loop.learning.strides)


def test_without_attempts_swing_begins_with_the_flippers_in_the_mud(configuration: Configuration) -> None:
    """Without a recovery the gait does not wait, which is the paper's extraction failure."""
    robot, recorder = walking(replace(configuration, recovery=NEVER), mud(7.5), 0.05)
    start_s = robot.now_s
    assert robot.run_until(lambda: robot.loop.target.stride == 1, 5.0)
    stride_s = stride_duration_s(configuration.gait, configuration.geometry, 0.05)
    assert robot.now_s - start_s == pytest.approx(stride_s, abs=2.0 * PERIOD_S)
    assert recorder.about("stuck") == []
    assert not any(stride.estimate.released for stride in robot.loop.learning.strides)


def free_itself(configuration: Configuration, kilopascal: float, log: Recorder | None = None) -> Lockstep:
    """Walk until the robot frees itself and inserts again; its body advances by at least half of a stride's 12 cm."""
    robot, recorder = walking(configuration, mud(kilopascal), 0.05, log)
    assert until_phase(robot, Phase.RECOVERY)
    stuck_s, stuck_m = robot.now_s, robot.robot.plant.body_m
    assert until_swing(robot)
    assert robot.now_s - stuck_s < longest_s(PARAMETERS)
    assert robot.robot.plant.body_m > stuck_m + 0.06
    assert recorder.texts[-1].startswith("the flippers came out after")
    assert until_closed(robot)
    assert [stride.estimate.released for stride in robot.loop.learning.strides] == [False, False]
    assert until_phase(robot, Phase.INSERTION)
    assert robot.loop.mode is Mode.WALKING
    geometry = configuration.geometry
    assert geometry.depth_m(*robot.robot.plant.angles_rad[:2]) == pytest.approx(-geometry.clearance_m, abs=0.002)
    return robot


def test_in_the_stiffest_mud_it_frees_itself_with_its_last_attempt_without_a_fault(
    configuration: Configuration,
) -> None:
    robot = free_itself(configuration, 9.0)
    assert isinstance(robot.loop.recorder, EventRecorder)
    assert len(robot.loop.recorder.about("stuck, attempt")) == PARAMETERS.attempts
    assert faults_since_arming(robot.loop.recorder) == []


def test_in_stiff_mud_it_frees_itself_and_a_replay_gives_the_same_strides_to_the_last_digit(
    tmp_path: Path, configuration: Configuration
) -> None:
    """It walks further than a robot without recoveries."""
    path = tmp_path / "walk.mcap"
    recorder = Recorder(path, configuration.text, {"robot": "test"})
    robot = free_itself(configuration, 5.0, recorder)
    assert recorder.close(20.0)
    live = [stride.estimate for stride in robot.loop.learning.strides]
    assert repr(replay_files([path]).strides) == repr(live)
    paper, _ = walking(replace(configuration, recovery=NEVER), mud(5.0), 0.05)
    paper.run_for(robot.now_s - paper.now_s)
    assert robot.robot.plant.body_m > 2.0 * paper.robot.plant.body_m


def test_one_flipper_alone_is_named_and_its_stride_alone_was_not_released(configuration: Configuration) -> None:
    robot, recorder = walking(configuration, mud(2.6), 0.05)
    robot.robot.plant.arms[1].track = mud(6.0)
    assert until_swing(robot)
    assert recorder.about("stuck")[0] == "the right flipper is stuck, attempt 1 of 3"
    assert until_closed(robot)
    released = {stride.estimate.flipper: stride.estimate.released for stride in robot.loop.learning.strides}
    assert released == {"left": True, "right": False}


def test_mud_that_never_releases_a_flipper_ends_in_a_fault_without_torque_in_bounded_time(recovering: Lockstep) -> None:
    robot, recorder = recovering, recovering.loop.recorder
    assert isinstance(recorder, EventRecorder)
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
    recovering: Lockstep, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_frames(now_s: float) -> Iterator[Frame]:
        return iter(())

    monkeypatch.setattr(recovering.robot.drives[1], "cyclic_frames", no_frames)
    assert recovering.run_until(lambda: recovering.loop.mode is Mode.FAULT, 0.1)
    assert recovering.loop.fault is not None
    assert recovering.loop.fault.name == "drive_silent"


def test_a_stop_in_a_recovery_is_obeyed(recovering: Lockstep) -> None:
    assert recovering.loop.request(Request.STOP, recovering.now_s) is None
    assert recovering.run_until(lambda: recovering.loop.mode is Mode.HOLD, 5.0)
    assert recovering.loop.events.notice == "the flippers did not come out of the mud"


def test_targets_stay_within_the_joints_limits_and_torque_within_its_own(
    configuration: Configuration, in_stance: Lockstep
) -> None:
    robot = hardened(in_stance, 9.0)
    limits = configuration.limits
    while robot.loop.mode is Mode.WALKING and robot.loop.target.phase is not Phase.INSERTION:
        robot.step()
        assert all(abs(torque_nm) <= limits.torque_nm for torque_nm in robot.loop.sent.torques_nm)
        for state, span in zip(robot.loop.states, configuration.joint_ranges, strict=True):
            assert span.min_rad - 0.02 < state.angle_rad < span.max_rad + 0.02
