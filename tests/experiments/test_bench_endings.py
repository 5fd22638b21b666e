"""At every ending of an experiment the flippers are out of the mud before the torque is off."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from control.controller import UP_RAD
from control.modes import ENERGISED, Mode
from control.parameters.fault_bounds import FaultBounds
from control.records import Phase
from experiments.robot.bench_errors import BenchError
from experiments.robot.bench_robot import arm, leave, move, rest, walk
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.study.prompt import AutomaticOperator
from logs.files.log_reader import read_log
from tests.experiments.robot.test_lockstep_robot import make_robot

OPERATOR = AutomaticOperator(lambda message: None)
ARMED_S = 0.01  # before all drives have reported closed loop


class InterruptedRobot(LockstepRobot):
    """A robot on which Ctrl-C is pressed in the nth wait of the experiment."""

    waits_left = -1
    sinks = 0  # how many requests to arm a sinking flipper prevents
    ended_by = ""  # the method that another client calls right after arming
    arms = 0

    def call(self, method: str, **params: Any) -> Any:
        answer = super().call(method, **params)
        self.arms += method == "arm"
        if method == "arm" and self.sinks:
            self.sinks -= 1
            self.lockstep.robot.plant.arms[0].adduction_rad += 0.05
        if method == "arm" and self.ended_by:
            self.lockstep.run_for(ARMED_S)
            super().call(self.ended_by)
        return answer

    def wait(self, duration_s: float) -> None:
        self.waits_left -= 1
        if self.waits_left == 0:
            raise KeyboardInterrupt
        super().wait(duration_s)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[InterruptedRobot]:
    made = make_robot(tmp_path, replace(simulated_configuration(), faults=FaultBounds()))
    made.__class__ = InterruptedRobot
    assert isinstance(made, InterruptedRobot)
    yield made
    made.close()


def last_angles_rad(folder: Path) -> np.ndarray:
    """Return the angles of both adduction joints when the torque went off."""
    ticks = read_log(folder / "log.mcap").ticks
    assert Mode(ticks["mode"][-1]) is Mode.IDLE and not ticks["torque_command_nm"][-1].any()
    energised = np.flatnonzero(np.isin(ticks["mode"], [int(mode) for mode in ENERGISED]))
    angles: np.ndarray = ticks["angle_rad"][energised[-1], [1, 3]]
    return angles


@pytest.mark.parametrize("waits", [2, 40, 68])
def test_ctrl_c_wherever_an_experiment_waits_ends_it_with_raised_flippers(
    robot: InterruptedRobot, tmp_path: Path, waits: int
) -> None:
    robot.waits_left = waits
    with pytest.raises(KeyboardInterrupt):
        arm(robot, OPERATOR)
        move(robot, {"left_adduction": 0.1})
        walk(robot, 0.03, 1)
    leave(robot, OPERATOR, tmp_path)
    modes = read_log(tmp_path / "log.mcap").ticks["mode"]
    assert modes[-1] not in ENERGISED
    if Mode.WALKING in modes:
        assert np.abs(last_angles_rad(tmp_path)).max() < UP_RAD


def test_flippers_in_the_mud_are_raised_before_the_torque_goes_off_after_a_fault(
    robot: InterruptedRobot, tmp_path: Path
) -> None:
    """One current is interrupted for a moment, so that the robot stops its walk and holds its pose in the mud."""
    arm(robot, OPERATOR)
    robot.call("walk", depth_m=0.03)
    loop = robot.lockstep.loop
    assert robot.lockstep.run_until(lambda: loop.target.phase is Phase.STANCE, 10.0)
    robot.wait(0.2)
    robot.lockstep.fail("left_sweep.current", "off", 0.015)
    robot.wait(0.3)
    status = robot.call("status")
    assert status["mode"] == "hold" and status["drives"][1]["angle_rad"] < -UP_RAD
    rest(robot)
    robot.close()
    assert np.abs(last_angles_rad(tmp_path)).max() < UP_RAD


def test_a_flipper_that_sinks_as_the_robot_is_armed_only_delays_it(robot: InterruptedRobot) -> None:
    robot.sinks = 2
    arm(robot)
    assert robot.sinks == 0 and robot.call("status")["mode"] == "hold"


def test_a_flipper_that_always_sinks_keeps_the_torque_off(robot: InterruptedRobot) -> None:
    robot.sinks = 1000
    with pytest.raises(BenchError, match="the robot is not armed: "):
        arm(robot)
    assert robot.call("status")["mode"] == "idle"


@pytest.mark.parametrize("ended_by", ["disarm", "stop"])
def test_torque_that_was_switched_off_at_once_is_not_asked_for_again(robot: InterruptedRobot, ended_by: str) -> None:
    robot.ended_by = ended_by
    with pytest.raises(BenchError, match=r"the robot is not armed: its torque was switched off\."):
        arm(robot)
    assert robot.arms == 1 and robot.call("status")["mode"] == "idle"
