"""Properties that the strides of one robot share in any mud.

Both flippers of a walk are in the same mud, so their difference is explained by their errors: the median size of a
normal deviation is 0.67. A bound says that the mud is at least so strong, so the strides next to it may not be weaker.
A log without mud has neither values nor bounds.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot
from typing import NamedTuple

import numpy as np

from control.records import FLIPPERS, Estimate
from estimation.estimation_parameters import Method
from experiments.lablogs.lab_trial import (
    LabTrial,
    Strides,
    claims_error,
    is_bound,
    is_value,
    pair_flippers,
    split_walks,
)
from experiments.reports.error_table import COEFFICIENTS

CONTRADICTING = 2.0  # standard errors
ALL = "all"


@dataclass(frozen=True)
class Counts:
    """Estimates of one coefficient by what they are."""

    values: int
    bounds: int
    invalid: int


@dataclass(frozen=True)
class Agreement:
    """The difference of both flippers over its claimed error: the median of its size, and the number of strides."""

    median: float | None
    n: int


@dataclass(frozen=True)
class Contradictions:
    """Bounds on k_e, those that have a value of the same flipper next to them, and those above such a value."""

    bounds: int
    with_neighbour: int
    contradicting: int


class FlipperPair(NamedTuple):
    """One coefficient of one stride by both flippers."""

    coefficient: str
    left: Estimate
    right: Estimate

    @property
    def difference(self) -> float:
        """In claimed errors."""
        return (self.left.value - self.right.value) / hypot(self.left.std_error, self.right.std_error)


def count_estimates(estimates: Iterable[Estimate]) -> Counts:
    found = list(estimates)
    values, bounds = sum(map(is_value, found)), sum(map(is_bound, found))
    return Counts(values, bounds, len(found) - values - bounds)


def flipper_pairs(trials: Sequence[LabTrial], method: Method) -> list[FlipperPair]:
    """Return the strides of walks in which both flippers have a value."""
    walks = [trial for trial in trials if len(trial.flippers) == len(FLIPPERS) and not trial.fixed_base]
    strides = [pair for trial in walks for pair in pair_flippers(trial.replays[method].recorded)]
    pairs = [FlipperPair(name, getattr(a, name), getattr(b, name)) for name in COEFFICIENTS for a, b in strides]
    return [pair for pair in pairs if claims_error(pair.left) and claims_error(pair.right)]


def agreements(pairs: Sequence[FlipperPair]) -> dict[str, Agreement]:
    """Return the agreement by coefficient and of all together."""
    return {
        name: _agreement([abs(pair.difference) for pair in pairs if name in (ALL, pair.coefficient)])
        for name in (*COEFFICIENTS, ALL)
    }


def _agreement(sizes: Sequence[float]) -> Agreement:
    return Agreement(round(float(np.median(sizes)), 4) if sizes else None, len(sizes))


def contradictions(trials: Sequence[LabTrial], method: Method) -> Contradictions:
    rows = [
        estimates_of(walk, "k_e")
        for trial in trials
        for flipper in trial.flippers
        for walk in split_walks(trial.replays[method].recorded, flipper)
    ]
    found = [neighbours for row in rows for neighbours in _bounds_with_neighbours(row)]
    return Contradictions(
        bounds=len(found),
        with_neighbour=sum(bool(values) for _, values in found),
        contradicting=sum(any(_contradicts(bound, value) for value in values) for bound, values in found),
    )


def _bounds_with_neighbours(row: Sequence[Estimate]) -> list[tuple[Estimate, list[Estimate]]]:
    """Return each bound with the values of the strides before and after it."""
    neighbours: dict[int, list[Estimate]] = {number: [] for number, each in enumerate(row) if is_bound(each)}
    for (number, one), (_, other) in pairwise(enumerate(row)):
        if is_bound(one) and is_value(other):
            neighbours[number].append(other)
        elif is_value(one) and is_bound(other):
            neighbours[number + 1].append(one)
    return [(row[number], values) for number, values in neighbours.items()]


def _contradicts(bound: Estimate, value: Estimate) -> bool:
    return bound.value - value.value > CONTRADICTING * hypot(bound.std_error, value.std_error)


def estimates_of(strides: Strides, name: str) -> list[Estimate]:
    return [getattr(stride, name) for stride in strides]
