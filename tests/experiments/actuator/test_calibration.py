"""The course of a calibration: the operator's answers, failures, and continuation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from control.records import JOINTS
from experiments.actuator import calibration as actuator
from experiments.actuator.calibration import KEEP, OTHER, Calibration
from experiments.actuator.friction import Loop
from experiments.actuator.plan import Plan, Step, steps_of
from experiments.actuator.reading import MovedError, Reading, Side
from experiments.actuator.simulation import bench_configuration
from experiments.robot.bench_errors import EndedError
from experiments.robot.bench_robot import LEAVE, BenchError
from experiments.robot.prompt import GO_ON, REDO, SKIP
from experiments.trials.notebook import Notebook
from firmware_host.configuration.configuration import Configuration
from tests.experiments.still_robot import StillRobot
from tests.scripted_operator import ScriptedOperator

JOINT = "right_adduction"
PLAN = Plan((JOINT,), weights_g=(100.0, 200.0, 400.0), trials=2)
TRUE_NM_A = 0.0719


class ScriptedRobot(StillRobot):
    """A BenchRobot whose winding warms by what hangs, and which lets go when it is told to."""

    configuration: Configuration = bench_configuration()

    def __init__(self) -> None:
        super().__init__("idle")
        self.winding_c, self.hanging_g, self.armed, self.message = 30.0, 0.0, 0, ""

    def call(self, method: str, **params: Any) -> Any:
        if method == "arm":
            self.mode, self.armed = "hold", self.armed + 1
        if method == "clear":
            self.mode = "idle"
        fault = {"message": self.message, "what_to_do": "do this", "blocks_arming": False, "age_s": 3.0}
        drives = [{"joint": joint, "winding_c": self.winding_c} for joint in JOINTS]
        standing: dict[str, Any] = {"mode": self.mode, "fault": fault if self.mode == "fault" else None, "notice": ""}
        standing |= {"now_s": self.now_s}
        return standing | {"drives": drives, "faults": [fault] if self.mode == "fault" else [], "moving": False}

    def wait(self, duration_s: float) -> None:
        super().wait(duration_s)
        self.winding_c = max(30.0, self.winding_c - duration_s)


class ScriptedWeights:
    """A WeightHandler that hangs what it is asked for, unless the script of a step says something else."""

    handling_s = 2.0

    def __init__(self, robot: ScriptedRobot, script: Mapping[str, list[Callable[[], str]]]) -> None:
        self.robot, self.script = robot, {key: list(answers) for key, answers in script.items()}
        self.asked: list[str] = []

    def hold_level(self, joint: str, meanwhile: Callable[[], None]) -> None:
        self.robot.hanging_g = 0.0

    def release(self, meanwhile: Callable[[], None]) -> None:
        meanwhile()

    def hang(self, step: Step, meanwhile: Callable[[], None]) -> str:
        self.meanwhile = meanwhile
        meanwhile()
        self.asked.append(step.key)
        self.robot.hanging_g = step.weight_g
        answers = self.script.get(step.key, [])
        return answers.pop(0)() if answers else GO_ON

    def take_off(self) -> None:
        self.robot.hanging_g = 0.0


class ScriptedJoint:
    """A HeldJoint that reads what hangs, to the last digit; a negative weight never comes to rest."""

    def __init__(self, robot: Any, joint: str) -> None:
        self.robot: ScriptedRobot = robot

    def read(self) -> Reading:
        if self.robot.mode != "hold":
            raise BenchError(f"the robot no longer holds its pose: {self.robot.message}")
        if self.robot.hanging_g < 0.0:
            raise MovedError("the joint swings by 3.00 degrees")
        current_a = PLAN.torque_nm(self.robot.hanging_g) / TRUE_NM_A + 0.6
        side = Side(0.0, current_a, 0.2, 0.0)
        return Reading(0.0, side, side, self.robot.winding_c)


LOOP = Loop(0.18, 0.2, quick=False)


@pytest.fixture(autouse=True)
def scripted_joint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(actuator, "HeldJoint", ScriptedJoint)
    monkeypatch.setattr(actuator, "swing_arm", lambda held: [LOOP])


class Case:
    """One calibration; `run` again goes on with it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.robot = ScriptedRobot()
        self.operator = ScriptedOperator()
        self.hand = ScriptedWeights(self.robot, {})
        self.shown: list[tuple[int, int]] = []

    def run(self) -> Mapping[str, Any]:
        notebook = Notebook(self.folder, asdict(PLAN))
        return Calibration(
            self.robot, JOINT, PLAN, self.hand, self.operator, notebook, lambda *at: self.shown.append(at)
        ).run()

    def on(self, step: Step, *answers: Callable[[], str]) -> None:
        self.hand.script[step.key] = list(answers)

    def hanging(self, grams: float) -> Callable[[], str]:
        """Something else hangs than what was asked for."""

        def hang() -> str:
            self.robot.hanging_g = grams
            return GO_ON

        return hang

    def letting_go(self, message: str) -> Callable[[], str]:
        def fail() -> str:
            self.robot.mode, self.robot.message = "fault", message
            return GO_ON

        return fail


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return Case(tmp_path)


def say(answer: str) -> Callable[[], str]:
    return lambda: answer


KEYS = [step.key for step in steps_of(PLAN)]


def test_everything_is_read_once_in_its_order(case: Case) -> None:
    entries = case.run()
    assert list(entries) == KEYS == case.hand.asked
    assert case.robot.armed == 1 and case.shown[0] == (0, 9) and case.shown[-1] == (9, 9)
    assert not case.operator.asked


def test_only_the_empty_arm_is_swung_and_not_where_something_may_hang(case: Case) -> None:
    case.operator.answers = [KEEP]
    case.on(Step(1, 0.0), case.hanging(100.0))
    entries = case.run()
    assert [key for key, entry in entries.items() if "loops" in entry] == [Step(0, 0.0).key, Step(2, 0.0).key]
    assert entries[Step(0, 0.0).key]["loops"] == [LOOP._asdict()]
    assert "should be empty" in entries[Step(1, 0.0).key]["doubt"]


def test_an_arm_that_does_not_swing_costs_its_friction_alone(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def blocked(held: object) -> list[Loop]:
        raise MovedError("the empty arm swings by 1.0 degrees only: is something in its way?")

    monkeypatch.setattr(actuator, "swing_arm", blocked)
    entries = case.run()
    assert list(entries) == KEYS and not any("loops" in entry for entry in entries.values())
    assert sum("friction was not measured" in reported for reported in case.operator.reported) == PLAN.trials + 1


def test_a_skipped_weight_is_noted_and_not_read(case: Case) -> None:
    case.on(Step(1, 200.0), say(SKIP))
    assert case.run()[Step(1, 200.0).key] == {"skipped": "on request"}


def test_the_one_before_is_read_again_when_asked(case: Case) -> None:
    case.on(Step(1, 200.0), say(REDO))
    assert list(case.run()) == [KEYS[0], *KEYS[1:]]
    assert case.hand.asked[:5] == [KEYS[0], KEYS[1], KEYS[2], KEYS[1], KEYS[2]]


def test_there_is_nothing_before_the_first(case: Case) -> None:
    case.on(Step(0, 0.0), say(REDO))
    assert len(case.run()) == len(KEYS)


def test_an_interrupted_calibration_continues(case: Case) -> None:
    def interrupt() -> str:
        raise KeyboardInterrupt

    case.on(Step(1, 400.0), interrupt)
    with pytest.raises(KeyboardInterrupt):
        case.run()
    case.hand.asked.clear()
    entries = case.run()
    assert case.hand.asked == KEYS[3:] and sorted(entries) == sorted(KEYS)


def test_a_lost_daemon_ends_the_calibration_and_costs_no_reading(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(method: str, **params: Any) -> Any:
        raise BenchError("the daemon on /run/x does not answer")

    def vanish() -> str:
        monkeypatch.setattr(case.robot, "call", gone)
        raise BenchError("no answer")

    case.on(Step(1, 200.0), vanish)
    with pytest.raises(BenchError, match="does not answer"):
        case.run()
    monkeypatch.undo()
    monkeypatch.setattr(actuator, "HeldJoint", ScriptedJoint)
    monkeypatch.setattr(actuator, "swing_arm", lambda held: [LOOP])
    case.hand.asked.clear()
    case.run()
    assert case.hand.asked == KEYS[2:]


def test_a_robot_that_lets_go_is_reported_and_armed_and_the_weight_read_again(case: Case) -> None:
    message = "The right_adduction motor has 80 degrees C."
    case.on(Step(1, 400.0), case.letting_go(message))
    entries = case.run()
    assert sorted(entries) == sorted(KEYS) and case.robot.armed == 2
    assert any("400 g was not read" in reported and message in reported for reported in case.operator.reported)
    assert case.hand.asked.count(Step(1, 400.0).key) == 2
    assert case.operator.asked == [
        f"The robot is in FAULT:\n  {message} (for 3 s)\n    -> do this\nTorque stays off until this is cleared."
    ]


def test_a_fault_that_the_operator_leaves_ends_the_calibration(case: Case) -> None:
    case.on(Step(1, 400.0), case.letting_go("The motor is wet."))
    case.operator.answers = [LEAVE]
    with pytest.raises(EndedError, match="the fault remains"):
        case.run()
    assert (case.robot.mode, case.robot.armed) == ("fault", 1)


def test_a_robot_that_lets_go_during_a_prompt_is_reported_at_once(case: Case) -> None:
    def doze() -> str:
        case.robot.mode, case.robot.message = "fault", "The supply is low."
        case.hand.meanwhile()
        raise AssertionError("nobody was told")

    case.on(Step(1, 200.0), doze)
    entries = case.run()
    assert any("200 g was not read" in reported and "supply is low" in reported for reported in case.operator.reported)
    assert sorted(entries) == sorted(KEYS)


def test_a_robot_that_always_lets_go_ends_the_calibration_with_its_message(case: Case) -> None:
    case.on(Step(1, 400.0), *[case.letting_go("The encoder is loose.")] * 9)
    with pytest.raises(BenchError, match="The encoder is loose"):
        case.run()
    assert case.hand.asked.count(Step(1, 400.0).key) == actuator.MOST_FAULTS


def test_a_warm_winding_is_waited_for_before_a_weight_and_not_before_a_light_one(case: Case) -> None:
    def warm() -> str:
        case.robot.winding_c = 69.0
        return GO_ON

    case.on(Step(1, 200.0), warm)
    case.run()
    assert [reported for reported in case.operator.reported if "waiting" in reported] == [
        "The right_adduction winding has 69 °C, too warm for 400 g: waiting."
    ]


def test_a_weight_is_taken_off_when_the_winding_gets_warm_during_a_prompt(case: Case) -> None:
    case.robot.winding_c = 69.0
    case.run()
    assert any("a weight would fall soon" in reported for reported in case.operator.reported)


def test_weights_in_the_wrong_order_are_named_and_may_be_swapped(case: Case) -> None:
    case.operator.answers = [OTHER]
    case.on(Step(1, 200.0), case.hanging(400.0))
    entries = case.run()
    assert "that is 400 g rather than 200 g" in case.operator.asked[0]
    assert case.hand.asked.count(Step(1, 400.0).key) == 0
    assert case.hand.asked.count(Step(1, 200.0).key) == 2
    assert entries[Step(1, 400.0).key]["current_a"] > entries[Step(1, 200.0).key]["current_a"]


def test_an_earlier_reading_is_not_replaced_by_a_mistake(case: Case) -> None:
    case.operator.answers = [OTHER]
    case.on(Step(1, 200.0), case.hanging(100.0))
    case.run()
    assert any("100 g of trial 1 was read already" in reported for reported in case.operator.reported)


def test_a_mismatched_reading_is_repeated_or_kept_as_doubtful(case: Case) -> None:
    case.operator.answers = [GO_ON, KEEP]
    case.on(Step(2, 400.0), case.hanging(0.0), case.hanging(0.0))
    entry = case.run()[Step(2, 400.0).key]
    assert "slip off" in entry["doubt"] and len(case.operator.asked) == 2


def test_pressing_enter_only_comes_to_an_end(case: Case) -> None:
    case.on(Step(2, 400.0), *[case.hanging(0.0)] * 9)
    assert "slip off" in case.run()[Step(2, 400.0).key]["doubt"]
    case.on(Step(2, 400.0))


def test_a_reading_that_moved_is_reported_and_repeated(case: Case) -> None:
    case.on(Step(1, 200.0), case.hanging(-1.0))
    entry = case.run()[Step(1, 200.0).key]
    assert "200 g did not come to rest: the joint swings by 3.00 degrees" in case.operator.asked[0]
    assert entry == {"skipped": "the joint swings by 3.00 degrees"}
    assert len(case.operator.asked) == actuator.MOST_REPEATS
