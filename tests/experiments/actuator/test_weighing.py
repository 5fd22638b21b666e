"""The sequence of a calibration: the operator's answers, failures, and continuation."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from experiments.actuator import weighing
from experiments.actuator.friction import Loop
from experiments.actuator.plan import WeighingPlan, WeighingStep, steps_of
from experiments.actuator.reading import MovedError
from experiments.actuator.simulation import bench_configuration
from experiments.actuator.weighing import KEEP, MOST_REPEATS, OTHER, JointWeighing, WeightHandler
from experiments.robot.bench_errors import BenchError
from experiments.study.notebook import Entry, Notebook
from experiments.study.prompt import GO_ON
from firmware_host.configuration.configuration import Configuration
from tests.experiments.still_robot import StillRobot
from tests.scripted_operator import ScriptedOperator

JOINT = "right_adduction"
PLAN = WeighingPlan((JOINT,), weights_g=(100.0, 200.0, 400.0), trials=2)
KEYS = [step.key for step in steps_of(PLAN)]
TRUE_NM_A = 0.0719
LOOP = Loop(0.18, 0.2, quick=False, held_a=0.6)


class ScriptedRobot(StillRobot):
    """A BenchRobot with a scripted mode, winding temperature and hanging weight; its winding cools while it waits."""

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
        faults = [fault] if self.mode == "fault" else []
        standing = {"mode": self.mode, "now_s": self.now_s, "notice": "", "fault": fault, "faults": faults}
        return standing | {"drives": [{"joint": JOINT, "winding_c": self.winding_c}]}

    def wait(self, duration_s: float) -> None:
        super().wait(duration_s)
        self.winding_c = max(30.0, self.winding_c - duration_s)


class ScriptedWeights(WeightHandler):
    """Hangs the requested weight, unless the script of the step says otherwise."""

    handling_s = 2.0

    def __init__(self, robot: ScriptedRobot, operator: ScriptedOperator) -> None:
        super().__init__(operator, PLAN, JOINT)
        self.robot = robot
        self.script: dict[str, list[Callable[[], str]]] = {}
        self.asked: list[str] = []

    def hold_level(self, meanwhile: Callable[[], None]) -> None:
        self.robot.hanging_g = 0.0

    def release(self, meanwhile: Callable[[], None]) -> None:
        meanwhile()

    def hang(self, step: WeighingStep, meanwhile: Callable[[], None]) -> str:
        self.meanwhile = meanwhile
        meanwhile()
        self.asked.append(step.key)
        self.robot.hanging_g = step.weight_g
        answers = self.script.get(step.key, [])
        return answers.pop(0)() if answers else GO_ON

    def take_off(self) -> None:
        self.robot.hanging_g = 0.0


class ScriptedJoint:
    """A HeldJoint that reads the hanging weight without an error."""

    def __init__(self, robot: Any, joint: str) -> None:
        self.robot: ScriptedRobot = robot

    def read(self) -> Entry:
        if self.robot.mode != "hold":
            raise BenchError(f"the robot no longer holds its pose: {self.robot.message}")
        current_a = PLAN.torque_nm(self.robot.hanging_g) / TRUE_NM_A + 0.6
        return {"current_a": current_a, "rest_friction_a": 0.0, "angle_rad": 0.0}


class Case:
    """Owns the parts of one calibration; a second `run` continues it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.robot = ScriptedRobot()
        self.operator = ScriptedOperator()
        self.hand = ScriptedWeights(self.robot, self.operator)
        self.shown: list[tuple[int, int]] = []

    def run(self) -> Mapping[str, Any]:
        notebook = Notebook(self.folder, asdict(PLAN))
        return JointWeighing(self.robot, self.hand, notebook, lambda *at: self.shown.append(at)).run()

    def on(self, step: WeighingStep, *answers: Callable[[], str]) -> None:
        self.hand.script[step.key] = list(answers)

    def hanging(self, grams: float) -> Callable[[], str]:
        """Return an answer of the script that hangs this weight instead of the requested one."""

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
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Case:
    monkeypatch.setattr(weighing, "HeldJoint", ScriptedJoint)
    monkeypatch.setattr(weighing, "swing_arm", lambda held: [LOOP])
    return Case(tmp_path)


def test_everything_is_read_once_in_its_order(case: Case) -> None:
    entries = case.run()
    assert list(entries) == KEYS == case.hand.asked
    assert case.robot.armed == 1 and case.shown[0] == (0, 9) and case.shown[-1] == (9, 9)
    assert not case.operator.asked


def test_only_the_empty_arm_is_swung_and_not_where_something_may_hang(case: Case) -> None:
    case.operator.answers = [KEEP]
    case.on(WeighingStep(1, 0.0), case.hanging(100.0))
    entries = case.run()
    loops = {key: entry["loops"] for key, entry in entries.items() if "loops" in entry}
    assert loops == {WeighingStep(trial, 0.0).key: [LOOP._asdict()] for trial in (0, 2)}
    assert "should be empty" in entries[WeighingStep(1, 0.0).key]["doubt"]


def test_an_arm_that_does_not_swing_costs_its_friction_alone(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def blocked(held: object) -> list[Loop]:
        raise MovedError("the empty arm swings by 1.0 degrees only: is something in its way?")

    monkeypatch.setattr(weighing, "swing_arm", blocked)
    entries = case.run()
    assert list(entries) == KEYS and not any("loops" in entry for entry in entries.values())
    assert sum("friction was not measured" in reported for reported in case.operator.reported) == PLAN.trials + 1


def test_an_interrupted_calibration_continues(case: Case) -> None:
    def interrupt() -> str:
        raise KeyboardInterrupt

    case.on(WeighingStep(1, 400.0), interrupt)
    with pytest.raises(KeyboardInterrupt):
        case.run()
    case.hand.asked.clear()
    entries = case.run()
    assert case.hand.asked == KEYS[3:] and sorted(entries) == sorted(KEYS)


@pytest.mark.parametrize("in_prompt", [False, True])
def test_a_robot_that_lets_go_is_reported_and_armed_and_the_weight_read_again(case: Case, in_prompt: bool) -> None:
    message, step = "The right_adduction motor has 80 degrees C.", WeighingStep(1, 400.0)
    let_go = case.letting_go(message)

    def doze() -> str:
        let_go()
        case.hand.meanwhile()
        raise AssertionError("the prompt did not end")

    case.on(step, doze if in_prompt else let_go)
    entries = case.run()
    assert sorted(entries) == sorted(KEYS) and case.robot.armed == 2 and case.hand.asked.count(step.key) == 2
    assert any("400 g was not read" in reported and message in reported for reported in case.operator.reported)
    (question,) = case.operator.asked
    assert message in question and "do this" in question


def test_a_robot_that_always_lets_go_ends_the_calibration_with_its_message(case: Case) -> None:
    case.on(WeighingStep(1, 400.0), *[case.letting_go("The encoder is loose.")] * 9)
    with pytest.raises(BenchError, match="The encoder is loose"):
        case.run()
    assert case.hand.asked.count(WeighingStep(1, 400.0).key) == weighing.MOST_FAULTS


def test_a_warm_winding_is_waited_for_before_a_weight_and_not_before_a_light_one(case: Case) -> None:
    def warm() -> str:
        case.robot.winding_c = 69.0
        return GO_ON

    case.on(WeighingStep(1, 200.0), warm)
    case.run()
    assert [reported for reported in case.operator.reported if "waiting" in reported] == [
        "The right_adduction winding has 69 °C, too warm for 400 g: waiting."
    ]


def test_a_weight_is_taken_off_when_the_winding_gets_warm_during_a_prompt(case: Case) -> None:
    case.robot.winding_c = 69.0
    case.run()
    assert any("a weight would fall soon" in reported for reported in case.operator.reported)


def test_weights_in_the_wrong_order_are_named_and_may_be_swapped(case: Case) -> None:
    lighter, heavier = WeighingStep(1, 200.0).key, WeighingStep(1, 400.0).key
    case.operator.answers = [OTHER]
    case.on(WeighingStep(1, 200.0), case.hanging(400.0))
    entries = case.run()
    assert "that is 400 g rather than 200 g" in case.operator.asked[0]
    assert (case.hand.asked.count(lighter), case.hand.asked.count(heavier)) == (2, 0)
    assert entries[heavier]["current_a"] > entries[lighter]["current_a"]


def test_a_mismatched_reading_is_repeated_until_it_is_kept_as_doubtful(case: Case) -> None:
    step = WeighingStep(2, 400.0)
    case.on(step, *[case.hanging(0.0)] * MOST_REPEATS)
    assert "slip off" in case.run()[step.key]["doubt"]
    assert [GO_ON in offered for offered in case.operator.offered] == [True, True, False]


def test_an_arm_that_never_rests_is_left_out_after_its_repetitions(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def swing(held: Any) -> None:
        raise MovedError("the joint swings by 0.20 degrees")

    monkeypatch.setattr(ScriptedJoint, "read", swing)
    assert all(entry["skipped"] for entry in case.run().values())
    assert len(case.operator.asked) == len(KEYS) * (MOST_REPEATS - 1)
