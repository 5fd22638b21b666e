"""An experiment operates a simulated robot through the daemon's calls, and the log contains what it did."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from control.modes import Mode
from control.parameters.motion_parameters import MotionParameters
from control.records import JOINTS
from drivers.fault_injection.failures import Failures
from experiments.robot.bench_errors import BenchError, EndedError
from experiments.robot.bench_robot import (
    CLEAR,
    LEAVE,
    arm,
    disarm,
    fetch_strides,
    move,
    require_hold,
    walk,
)
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import read_log
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.scripted_operator import ScriptedOperator


def make_robot(folder: Path, configuration: Configuration) -> LockstepRobot:
    recorder, failures = FileRecorder(folder / "log.mcap", configuration), Failures(configuration.bus)
    track = Track([(5.0, MUDS["48.5"])])
    return LockstepRobot(Lockstep(configuration, track, recorder=recorder, failures=failures), recorder)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[LockstepRobot]:
    made = make_robot(tmp_path, simulated_configuration())
    try:
        yield made
    finally:
        made.close()


def test_a_walk_comes_back_with_its_strides_and_its_rows(robot: LockstepRobot, tmp_path: Path) -> None:
    arm(robot)
    walked = walk(robot, 0.03, 2)
    assert [(stride["flipper"], stride["index"]) for stride in walked.strides] == [
        ("left", 0), ("right", 0), ("left", 1), ("right", 1),
    ]  # fmt: skip
    rows = robot.record(walked.from_s, walked.to_s)
    assert len(rows.strides) == 4
    assert np.sum(rows.ticks["mode"] == Mode.WALKING) > 0.9 * 380 * 2 * 2.0
    assert walked.from_s <= rows.ticks["stamp_s"][0] and rows.ticks["stamp_s"][-1] <= walked.to_s
    disarm(robot)
    (log,) = robot.copy_logs(tmp_path / "..")
    assert read_log(log).complete


def stop(robot: LockstepRobot) -> None:
    robot.call("stop")


def restart_right_sweep(robot: LockstepRobot) -> None:
    robot.lockstep.robot.restart_drive(JOINTS.index("right_sweep"))


@pytest.mark.parametrize(
    ("end", "why"),
    [
        (stop, "ended early, after [1-3] of 4 strides"),
        (restart_right_sweep, "the walk ended early: stopped by .*right_sweep"),
    ],
)
def test_a_walk_that_another_program_or_a_fault_ends_is_not_complete(
    robot: LockstepRobot, monkeypatch: pytest.MonkeyPatch, end: Callable[[LockstepRobot], None], why: str
) -> None:
    arm(robot)
    wait, ended_s = robot.wait, robot.lockstep.now_s + 5.0

    def ending(duration_s: float) -> None:
        wait(duration_s)
        if robot.lockstep.now_s > ended_s and robot.call("status")["mode"] == "walking":
            end(robot)

    monkeypatch.setattr(robot, "wait", ending)
    with pytest.raises(BenchError, match=why):
        walk(robot, 0.03, 4)


def test_a_robot_that_was_held_too_long_reports_why_it_let_go(robot: LockstepRobot) -> None:
    robot.lockstep.loop.controller.motion = MotionParameters(longest_hold_s=1.0)
    arm(robot)
    robot.wait(0.8)
    move(robot, {"right_adduction": 0.2})  # a request restarts the time of the hold
    robot.wait(0.8)
    require_hold(robot.call("status"))
    robot.wait(0.3)
    with pytest.raises(BenchError, match="held for .* without a request: torque went off by itself"):
        move(robot, {"right_adduction": 0.1})


def test_a_fault_is_cleared_only_where_the_operator_agrees(robot: LockstepRobot) -> None:
    arm(robot)
    restart_right_sweep(robot)  # under torque
    robot.wait(3.0)
    with pytest.raises(EndedError, match="the fault remains; remove its cause, then 'mudskipper clear'"):
        arm(robot, ScriptedOperator(LEAVE))
    assert robot.call("status")["mode"] == "fault"
    operator = ScriptedOperator(CLEAR)
    arm(robot, operator)
    assert robot.call("status")["mode"] == "hold"
    assert list(operator.offered[0]) == [CLEAR, LEAVE]  # an automatic operator takes the first
    (question,) = operator.asked
    assert question.startswith("The robot is in FAULT:\n") and "right_sweep" in question


def test_a_transient_fault_makes_no_prompt(robot: LockstepRobot) -> None:
    robot.wait(1.0)
    robot.lockstep.fail("left_sweep.position", "off", 2.0)
    robot.wait(1.9)
    assert any(fault["blocks_arming"] for fault in robot.call("status")["faults"])
    operator = ScriptedOperator(LEAVE)
    arm(robot, operator)
    assert operator.asked == [] and robot.call("status")["mode"] == "hold"


@pytest.mark.parametrize(("kept", "whole"), [(45, True), (44, False)])
def test_strides_that_the_daemon_no_longer_keeps_are_not_passed_over(
    robot: LockstepRobot, monkeypatch: pytest.MonkeyPatch, kept: int, whole: bool
) -> None:
    strides = [{"number": number} for number in range(5, 50)][-kept:]
    report = lambda method, since: [stride for stride in strides if stride["number"] >= since][:20]  # noqa: E731
    monkeypatch.setattr(robot, "call", report)
    if whole:
        assert fetch_strides(robot, 5) == strides
    else:
        with pytest.raises(BenchError, match="more strides than the daemon stores"):
            fetch_strides(robot, 5)
