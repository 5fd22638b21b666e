"""The operator at a real bench answers prompts; at a simulated bench the answers come from the mechanics."""

from __future__ import annotations

import pytest

from experiments.bench.operator import BenchOperator, Observation
from tests.scripted_operator import ScriptedOperator


def nothing() -> None: ...


@pytest.mark.parametrize(("answer", "consents"), [("", True), ("n", False)])
def test_nothing_moves_without_permission(answer: str, consents: bool) -> None:
    operator = ScriptedOperator(answer)
    assert BenchOperator(operator, sure=False).allows_motion("It moves.", nothing) is consents
    assert operator.asked == ["It moves."]


def test_permission_in_advance_is_reported_and_not_asked_for() -> None:
    operator = ScriptedOperator("n")
    assert BenchOperator(operator, sure=True).allows_motion("It moves.", nothing)
    assert (operator.asked, operator.reported) == ([], ["It moves."])


@pytest.mark.parametrize(
    ("answer", "observation"),
    [("", Observation.RIGHT), ("w", Observation.OPPOSITE), ("o", Observation.OTHER), ("n", Observation.NOTHING)],
)
def test_the_answer_is_the_observation(answer: str, observation: Observation) -> None:
    operator = ScriptedOperator(answer)
    assert BenchOperator(operator, sure=True).observed_motion("right_adduction", 3, (), nothing) is observation
    assert "the right flipper rise" in operator.asked[0]


@pytest.mark.parametrize(("answer", "done"), [("", True), ("s", False)])
def test_manual_checks_can_be_skipped(answer: str, done: bool) -> None:
    bench_operator = BenchOperator(ScriptedOperator(answer, answer))
    assert bench_operator.hold_level(nothing) is done
    assert bench_operator.turn_joint("left_sweep", nothing) is done


@pytest.mark.parametrize(
    ("seen_rad", "observation"),
    [
        ((0.0, 0.0, 0.0, 0.2), Observation.RIGHT),
        ((0.0, 0.0, 0.01, -0.2), Observation.OPPOSITE),
        ((0.0, 0.2, 0.0, 0.0), Observation.OTHER),
        ((0.0, 0.2, 0.0, 0.2), Observation.OTHER),
        ((0.0, 0.0, 0.0, 0.01), Observation.NOTHING),
    ],
)
def test_what_simulated_eyes_see_is_the_observation(seen_rad: tuple[float, ...], observation: Observation) -> None:
    assert BenchOperator().observed_motion("right_adduction", 3, seen_rad, nothing) is observation
