"""The operator is asked to take a weight off before the torque goes off, however a calibration ends."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from experiments.actuator.bench import FALLS, attended, weigh_on_robot
from experiments.actuator.plan import WeighingPlan
from experiments.actuator.simulation import simulated_bench
from experiments.robot.bench_errors import BenchError, RobotInUseError
from experiments.robot.bench_robot import arm
from experiments.study.session import Session
from firmware_host.configuration.loading import load_configuration
from tests.experiments.still_robot import StillRobot
from tests.folders import EXAMPLE_CONFIGURATION
from tests.scripted_operator import ScriptedOperator

HOLD_IT = "Take off the weight and hold the flipper: torque goes off."
PLAN = WeighingPlan(("right_adduction",), weights_g=(50.0,), trials=1)


class HoldingRobot(StillRobot):
    """A BenchRobot that holds a joint until it is disarmed; with `trouble` every call fails."""

    def __init__(self, trouble: BenchError | None = None) -> None:
        super().__init__("hold")
        self.trouble = trouble
        self.waited_in: set[str] = set()  # modes

    def call(self, method: str, **params: Any) -> Any:
        if self.trouble:
            raise self.trouble
        if method == "disarm":
            self.mode = "idle"
        return {"mode": self.mode, "faults": [], "now_s": self.now_s}

    def wait(self, duration_s: float) -> None:
        self.waited_in.add(self.mode)
        if self.trouble:
            raise self.trouble


class Impatient(ScriptedOperator):
    """An operator who presses Ctrl-C at each question."""

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        self.asked.append(question)
        raise KeyboardInterrupt


def session_of(operator: ScriptedOperator, folder: Path) -> Session:
    return Session(folder, operator, lambda done, total: None)


def leave(robot: HoldingRobot, operator: ScriptedOperator, folder: Path) -> None:
    with attended(robot, session_of(operator, folder)):
        pass


def test_weights_are_taken_off_before_an_interrupted_calibration_disarms(tmp_path: Path) -> None:
    robot, operator = HoldingRobot(), ScriptedOperator()
    leave(robot, operator, tmp_path)
    assert len(operator.asked) == 1 and operator.asked[0].endswith(HOLD_IT)
    assert robot.waited_in == {"hold"} and robot.mode == "idle" and robot.closed


def test_a_second_ctrl_c_switches_the_torque_off_at_once(tmp_path: Path) -> None:
    robot, operator = HoldingRobot(), Impatient()
    with pytest.raises(KeyboardInterrupt):
        leave(robot, operator, tmp_path)
    assert len(operator.asked) == 1
    assert robot.mode == "idle" and robot.closed


def test_the_torque_of_a_robot_that_was_taken_over_stays_on(tmp_path: Path) -> None:
    robot, operator = HoldingRobot(RobotInUseError("taken over: uid 1")), ScriptedOperator()
    with pytest.raises(RobotInUseError):
        leave(robot, operator, tmp_path)
    assert not operator.asked and robot.mode == "hold" and robot.closed
    assert operator.reported == ["another program operates the robot now: it is left as it is"]


def test_torque_goes_off_and_the_operator_is_warned_before_a_joint_is_mounted(tmp_path: Path) -> None:
    robot, operator = HoldingRobot(), Impatient()
    with pytest.raises(KeyboardInterrupt):
        weigh_on_robot(robot, PLAN, session_of(operator, tmp_path))
    assert operator.asked == [f"The robot holds its pose. {HOLD_IT}"]
    robot.mode = "idle"
    with pytest.raises(KeyboardInterrupt):
        weigh_on_robot(robot, PLAN, session_of(operator, tmp_path))
    assert operator.reported == [FALLS] and "Mount the robot" in operator.asked[1]


def test_a_simulated_bench_arms_a_robot_that_is_not_calibrated_yet(tmp_path: Path) -> None:
    configuration = load_configuration(EXAMPLE_CONFIGURATION)
    robot, _ = simulated_bench(configuration, "right_adduction", PLAN, 1, tmp_path / "log.mcap")
    arm(robot)
    assert robot.call("status")["mode"] == "hold"
    robot.close()
