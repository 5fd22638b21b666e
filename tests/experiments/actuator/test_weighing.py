"""The sequence of a calibration: the operator's answers, failures, and continuation."""

from pathlib import Path
from typing import Any

import pytest

from experiments.actuator import weighing
from experiments.actuator.friction import Loop
from experiments.actuator.plan import WeighingStep, steps_of
from experiments.actuator.reading import MovedError
from experiments.actuator.weighing import KEEP, MOST_REPEATS, OTHER
from experiments.robot.bench_errors import BenchError
from experiments.study.prompt import GO_ON
from tests.experiments.actuator.scripted_weighing import LOOP, PLAN, Case, ScriptedJoint


@pytest.fixture(autouse=True)
def scripted_joint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weighing, "HeldJoint", ScriptedJoint)
    monkeypatch.setattr(weighing, "swing_arm", lambda held: [LOOP])


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return Case(tmp_path)


KEYS = [step.key for step in steps_of(PLAN)]


def test_everything_is_read_once_in_its_order(case: Case) -> None:
    entries = case.run()
    assert list(entries) == KEYS == case.hand.asked
    assert case.robot.armed == 1 and case.shown[0] == (0, 9) and case.shown[-1] == (9, 9)
    assert not case.operator.asked


def test_only_the_empty_arm_is_swung_and_not_where_something_may_hang(case: Case) -> None:
    case.operator.answers = [KEEP]
    case.on(WeighingStep(1, 0.0), case.hanging(100.0))
    entries = case.run()
    assert [key for key, entry in entries.items() if "loops" in entry] == [
        WeighingStep(0, 0.0).key,
        WeighingStep(2, 0.0).key,
    ]
    assert entries[WeighingStep(0, 0.0).key]["loops"] == [LOOP._asdict()]
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


def test_a_robot_that_lets_go_is_reported_and_armed_and_the_weight_read_again(case: Case) -> None:
    message = "The right_adduction motor has 80 degrees C."
    case.on(WeighingStep(1, 400.0), case.letting_go(message))
    entries = case.run()
    assert sorted(entries) == sorted(KEYS) and case.robot.armed == 2
    assert any("400 g was not read" in reported and message in reported for reported in case.operator.reported)
    assert case.hand.asked.count(WeighingStep(1, 400.0).key) == 2
    assert case.operator.asked == [
        f"The robot is in FAULT:\n  {message} (for 3 s)\n    -> do this\nTorque stays off until this is cleared."
    ]


def test_a_robot_that_lets_go_during_a_prompt_is_reported_at_once(case: Case) -> None:
    def doze() -> str:
        case.robot.mode, case.robot.message = "fault", "The supply is low."
        case.hand.meanwhile()
        raise AssertionError("the prompt did not end")

    case.on(WeighingStep(1, 200.0), doze)
    entries = case.run()
    assert any("200 g was not read" in reported and "supply is low" in reported for reported in case.operator.reported)
    assert sorted(entries) == sorted(KEYS)


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
    case.operator.answers = [OTHER]
    case.on(WeighingStep(1, 200.0), case.hanging(400.0))
    entries = case.run()
    assert "that is 400 g rather than 200 g" in case.operator.asked[0]
    assert case.hand.asked.count(WeighingStep(1, 400.0).key) == 0
    assert case.hand.asked.count(WeighingStep(1, 200.0).key) == 2
    assert entries[WeighingStep(1, 400.0).key]["current_a"] > entries[WeighingStep(1, 200.0).key]["current_a"]


def test_a_mismatched_reading_is_repeated_or_kept_as_doubtful(case: Case) -> None:
    case.operator.answers = [GO_ON, KEEP]
    case.on(WeighingStep(2, 400.0), case.hanging(0.0), case.hanging(0.0))
    entry = case.run()[WeighingStep(2, 400.0).key]
    assert "slip off" in entry["doubt"] and len(case.operator.asked) == 2


def test_no_repetition_is_offered_that_is_not_made(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    step = WeighingStep(2, 400.0)
    case.on(step, *[case.hanging(0.0)] * MOST_REPEATS)
    assert "doubt" in case.run()[step.key]
    assert [GO_ON in offered for offered in case.operator.offered] == [True, True, False]

    def swing(held: Any) -> None:
        raise MovedError("the joint swings by 0.20 degrees")

    monkeypatch.setattr(ScriptedJoint, "read", swing)
    case.folder, case.operator.asked = case.folder / "again", []
    assert all(entry["skipped"] for entry in case.run().values())
    assert len(case.operator.asked) == len(steps_of(PLAN)) * (MOST_REPEATS - 1)
