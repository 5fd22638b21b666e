"""In synthetic walks over borders the transitions and the strides until the estimate has followed are counted."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest
from pandas import DataFrame

import experiments.trials.transitions
from control.mud_estimate import FlipperEstimate, MudEstimate
from control.records import FLIPPERS
from experiments.trials.transitions import transition_rows, transitions_of
from experiments.trials.trial import SINGLE, Trial, configuration_of
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.mud.clay import Clay
from tests.control.synthetic_muds import reported

DEPTH_M = 0.03
Row = dict[str, Any]
K_P = {"soft": 1e6, "firm": 2e6}


def transition(strides: int | None, flipper: str = "left", before: str = "soft", after: str = "firm") -> Row:
    return {"before": before, "after": after, "flipper": flipper, "strides": strides}


# rows


def rows_of(*transitions: Row) -> list[Row]:
    return transition_rows(DataFrame(list(transitions)))


def test_transitions_within_two_strides_are_given_as_a_fraction_for_each_direction() -> None:
    back = transition(2, before="firm", after="soft")
    rows = rows_of(transition(1), back, transition(2), transition(3), transition(2, "right"))
    assert rows == [
        {"from": "soft", "to": "firm", "transitions": 4, "within_two": 0.75, "most_strides": 3},
        {"from": "firm", "to": "soft", "transitions": 1, "within_two": 1.0, "most_strides": 2},
    ]
    assert rows_of() == []


def test_a_transition_that_was_never_followed_is_reported_as_never() -> None:
    (row,) = rows_of(transition(1), transition(None))
    assert (row["within_two"], row["most_strides"]) == (0.5, "never")


# transitions


def stride(flipper: str, index: int, mud: str) -> StrideTruth:
    stroke = StrokeTruth(0.0, 0.0, DEPTH_M, 0.1, 0.0, DEPTH_M)
    return StrideTruth(flipper, index, Clay(mud, 1000.0), 0.0, stroke, stroke, stroke)


def mud_estimate(k_p: float | None, depth_m: float = DEPTH_M) -> MudEstimate:
    """Return the same estimate for both flippers."""
    if k_p is None:
        return MudEstimate()
    one = FlipperEstimate(reported(k_p, depth_m=depth_m, exponent=-1.0))
    return MudEstimate(left=one, right=one)


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Row]]:
    """Provide the transitions of a walk by the mud of each stride and both flippers' estimate of k_p after it."""

    def transitions(muds: Sequence[str], estimates: Sequence[float | None], depth_m: float = DEPTH_M) -> list[Row]:
        truths = [stride(flipper, i, mud) for i, mud in enumerate(muds) for flipper in FLIPPERS]
        replayed = [(SimpleNamespace(index=i), mud_estimate(k_p, depth_m)) for i, k_p in enumerate(estimates)]
        monkeypatch.setattr(experiments.trials.transitions, "replay_trial", lambda trial, parameters: replayed)
        trial = Trial(configuration_of(SINGLE), cast(Any, None), (), truths, seed=1)
        return transitions_of(
            trial, {(truth.flipper, truth.index): {"k_p": K_P[truth.ground.name]} for truth in truths}
        )

    return transitions


@pytest.mark.parametrize(
    ("estimates", "strides"),
    [
        ((1e6, 1e6, 2e6, 2e6, 2e6), 1),
        ((1e6, 1e6, 1e6, 2e6, 2e6), 2),
        ((1e6, 1e6, 1e6, None, 2e6), 3),
        ((1e6, 1e6, 1e6, 1e6, 1e6), None),
        ((1e6, 1e6, 2e6, 1e6, 1e6), 1),  # later estimates do not matter
        *(((1e6, 1e6, *[factor * 2e6] * 3), 1) for factor in (0.801, 1.199)),  # within a fifth of the truth
        *(((1e6, 1e6, *[factor * 2e6] * 3), None) for factor in (0.799, 1.201)),
    ],
)
def test_strides_are_counted_from_the_first_in_the_next_mud_until_the_estimate_has_followed(
    estimates: Sequence[float | None], strides: int | None, found: Callable[..., list[Row]]
) -> None:
    transitions = found(("soft", "soft", "firm", "firm", "firm"), estimates)
    assert transitions == [transition(strides), transition(strides, "right")]


def test_the_estimate_is_evaluated_at_the_depth_of_the_stride(found: Callable[..., list[Row]]) -> None:
    """k ∝ 1/z here: 4 million at 1.5 cm are 2 million at 3 cm."""
    assert [each["strides"] for each in found(("soft", "firm"), (1e6, 4e6), DEPTH_M / 2.0)] == [1, 1]


def test_the_next_border_ends_a_transition(found: Callable[..., list[Row]]) -> None:
    """An estimate that becomes right again only because the next mud begins has not followed."""
    walked = found(("soft", "firm", "firm", "soft", "soft"), [1e6] * 5)
    left = [each for each in walked if each["flipper"] == "left"]
    assert left == [transition(None), transition(1, before="firm", after="soft")]
