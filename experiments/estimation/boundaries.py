"""How soon the robot knows that it is in another mud: walks across borders that it is not told of.

A crossing begins with the first stride of a flipper whose insertion was in the next mud. It is followed once what
that flipper believes of k_p is within FOLLOWED of the truth there; strides are counted with that one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from control.records import FLIPPERS
from experiments.trials.load_cell_truth import LoadCellTruth
from experiments.trials.trial import Trial, mud_estimates
from simulation.body.reference_sensor import StrideTruth

FOLLOWED = 0.2  # of the truth: half of the smallest step between the muds


class CrossCoupling(NamedTuple):
    before: str
    after: str
    flipper: str
    strides: int | None  # until it was followed; None where it was not before the next border or the end


def crossings_of(trial: Trial, truths: Mapping[tuple[str, int], LoadCellTruth]) -> list[CrossCoupling]:
    beliefs = mud_estimates(trial, trial.configuration.estimation)
    return [cross_coupling for flipper in FLIPPERS for cross_coupling in _of_flipper(flipper, trial, truths, beliefs)]


def _of_flipper(
    flipper: str, trial: Trial, truths: Mapping[tuple[str, int], LoadCellTruth], beliefs: Mapping[int, Any]
) -> list[CrossCoupling]:
    strides = [truth for truth in trial.truths if truth.flipper == flipper and truth.index in beliefs]
    starts = [i for i in range(1, len(strides)) if strides[i].clay.name != strides[i - 1].clay.name]
    crossings = []
    for start, end in pairwise([*starts, len(strides)]):
        close = [_is_close(stride, truths, beliefs) for stride in strides[start:end]]
        if close:
            followed = close.index(True) + 1 if True in close else None
            crossings.append(CrossCoupling(strides[start - 1].clay.name, strides[start].clay.name, flipper, followed))
    return crossings


def _is_close(stride: StrideTruth, truths: Mapping[tuple[str, int], LoadCellTruth], beliefs: Mapping[int, Any]) -> bool:
    believed = beliefs[stride.index].of(stride.flipper).k_p
    if believed is None:
        return False
    value, _ = believed.at(max(stride.insertion.deepest_m, stride.stance.deepest_m))  # as a stride tells its depth
    return bool(abs(value / truths[stride.flipper, stride.index].leaning.k_p - 1.0) <= FOLLOWED)


def boundary_rows(crossings: Sequence[CrossCoupling]) -> list[dict[str, Any]]:
    groups: dict[tuple[str, str], list[CrossCoupling]] = {}
    for cross_coupling in crossings:
        groups.setdefault(cross_coupling[:2], []).append(cross_coupling)
    return [
        {
            "from": before,
            "to": after,
            "crossings": len(group),
            "within_two": round(sum(c.strides is not None and c.strides <= 2 for c in group) / len(group), 4),
            "most_strides": "never" if any(c.strides is None for c in group) else max(c.strides or 0 for c in group),
        }
        for (before, after), group in groups.items()
    ]
