"""Walks across borders that are made up: which strides cross them, and after how many the belief has followed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import pytest

import experiments.estimation.boundaries
from control.mud_estimate import Coefficient, FlipperEstimate, MudEstimate
from control.records import FLIPPERS
from experiments.estimation.boundaries import CrossCoupling, boundary_rows, crossings_of
from experiments.trials.load_cell_truth import LoadCellTruth, TrueCoefficients
from experiments.trials.trial import SINGLE, Trial, configuration_of
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.mud.clay import Clay

DEPTH_M = 0.03
K_P = {"soft": 1e6, "firm": 2e6}


def crossed(strides: int | None, flipper: str = "left", before: str = "soft", after: str = "firm") -> CrossCoupling:
    return CrossCoupling(before, after, flipper, strides)


# rows


def test_crossings_within_two_strides_are_a_share() -> None:
    (row,) = boundary_rows([crossed(1), crossed(2), crossed(3), crossed(2, "right")])
    assert row == {"from": "soft", "to": "firm", "crossings": 4, "within_two": 0.75, "most_strides": 3}


def test_a_crossing_that_was_not_followed_is_never() -> None:
    (row,) = boundary_rows([crossed(1), crossed(None)])
    assert (row["within_two"], row["most_strides"]) == (0.5, "never")


def test_each_direction_is_a_row_of_its_own() -> None:
    rows = boundary_rows([crossed(1), crossed(2, before="firm", after="soft"), crossed(1)])
    assert [(row["from"], row["to"], row["crossings"]) for row in rows] == [("soft", "firm", 2), ("firm", "soft", 1)]
    assert boundary_rows([]) == []


# crossings


def stride(flipper: str, index: int, mud: str) -> StrideTruth:
    stroke = StrokeTruth(0.0, 0.0, DEPTH_M, 0.1, 0.0, DEPTH_M)
    return StrideTruth(flipper, index, Clay(mud, 1000.0), 0.0, stroke, stroke, stroke)


def mud_estimate(k_p: float | None, depth_m: float = DEPTH_M) -> MudEstimate:
    """The same of both flippers."""
    if k_p is None:
        return MudEstimate()
    one = FlipperEstimate(Coefficient(k_p, 0.0, depth_m, -1.0, 0.0, 1))
    return MudEstimate(left=one, right=one)


@dataclass
class Walk:
    """Muds stride by stride, and what was believed of k_p after each; both flippers alike."""

    muds: Sequence[str]
    believed: Sequence[float | None]
    depth_m: float = DEPTH_M

    def crossings(self, monkeypatch: pytest.MonkeyPatch) -> list[CrossCoupling]:
        truths = [stride(flipper, i, mud) for i, mud in enumerate(self.muds) for flipper in FLIPPERS]
        beliefs = {i: mud_estimate(k_p, self.depth_m) for i, k_p in enumerate(self.believed)}
        monkeypatch.setattr(experiments.estimation.boundaries, "mud_estimates", lambda trial, parameters: beliefs)
        trial = Trial(configuration_of(SINGLE), cast(Any, None), (), truths)
        return crossings_of(trial, self.cells(truths))

    def cells(self, truths: Sequence[StrideTruth]) -> Mapping[tuple[str, int], LoadCellTruth]:
        leaning = {name: TrueCoefficients(k_p, 1.0, 1.0) for name, k_p in K_P.items()}
        wrong = TrueCoefficients(1.0, 1.0, 1.0)  # the upright plate must not matter
        return {(truth.flipper, truth.index): LoadCellTruth(leaning[truth.clay.name], wrong) for truth in truths}


@pytest.mark.parametrize(
    ("believed", "strides"),
    [
        ((1e6, 1e6, 2e6, 2e6, 2e6), 1),
        ((1e6, 1e6, 1e6, 2e6, 2e6), 2),
        ((1e6, 1e6, 1e6, None, 2e6), 3),
        ((1e6, 1e6, 1e6, 1e6, 1e6), None),
        ((1e6, 1e6, 2e6, 1e6, 1e6), 1),  # what comes after does not matter
    ],
)
def test_strides_are_counted_from_the_first_in_the_next_mud(
    believed: Sequence[float | None], strides: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = Walk(("soft", "soft", "firm", "firm", "firm"), believed)
    assert walk.crossings(monkeypatch) == [crossed(strides), crossed(strides, "right")]


@pytest.mark.parametrize(("off", "strides"), [(0.199, 1), (0.201, None)])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_within_a_fifth_of_the_truth_is_followed(
    sign: float, off: float, strides: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = Walk(("soft", "firm"), (1e6, (1.0 + sign * off) * 2e6))
    assert [cross_coupling.strides for cross_coupling in walk.crossings(monkeypatch)] == [strides, strides]


def test_a_belief_is_asked_for_the_strides_own_depth(monkeypatch: pytest.MonkeyPatch) -> None:
    """k ∝ 1/z here: 4 million at 1.5 cm are 2 million at 3 cm."""
    walk = Walk(("soft", "firm"), (1e6, 4e6), depth_m=DEPTH_M / 2.0)
    assert [cross_coupling.strides for cross_coupling in walk.crossings(monkeypatch)] == [1, 1]


def test_the_next_border_ends_a_crossing(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is right again behind it has not been followed before it."""
    walk = Walk(("soft", "firm", "firm", "soft", "soft"), (1e6, 1e6, 1e6, 1e6, 1e6))
    left = [cross_coupling for cross_coupling in walk.crossings(monkeypatch) if cross_coupling.flipper == "left"]
    assert left == [crossed(None), crossed(1, before="firm", after="soft")]


def test_a_walk_on_one_mud_crosses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Walk(("soft", "soft"), (1e6, 1e6)).crossings(monkeypatch) == []


def test_a_stride_of_which_nothing_was_believed_yet_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """The walk ended before its last stride closed."""
    assert Walk(("soft", "soft", "firm"), (1e6, 1e6)).crossings(monkeypatch) == []
