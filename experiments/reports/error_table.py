"""Errors of estimated coefficients against their true values, by setup, mud, coefficient and method.

The error of an estimate is |estimate / truth - 1|, and its 95 % interval reaches 1.96 standard errors to either side.
A lower bound has no error: bounds are counted apart, with the fraction of them that are right. A second table compares
the plate as the flipper carries it, leaning, with the upright plate of the paper's load cell.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, NamedTuple, TypeVar

import numpy as np

from control.records import Estimate

COEFFICIENTS = ("k_p", "k_s", "k_e")
NORMAL_95 = 1.96
Key = TypeVar("Key", bound=Hashable)


class Evaluation(NamedTuple):
    """One coefficient of one stride, estimated by one method, with its true value in N/m³."""

    setup: str
    mud: str
    coefficient: str
    method: str
    estimate: Estimate
    truth: float
    upright: float  # the reading of the paper's load cell; NaN where it is unknown

    @property
    def is_value(self) -> bool:
        return self.estimate.valid and not self.estimate.at_least

    @property
    def is_bound(self) -> bool:
        return self.estimate.valid and self.estimate.at_least


@dataclass(frozen=True)
class ErrorRow:
    """The errors of one method for one coefficient in one mud. None where there is no such estimate."""

    setup: str
    mud: str
    coefficient: str
    method: str
    median: float | None
    p95: float | None
    bias: float | None  # median of estimate / truth - 1
    coverage: float | None  # fraction of the 95 % intervals that contain the truth
    strides: int  # with a value
    bounds: int
    bounds_hold: float | None  # fraction of the bounds that are below the truth, within their errors
    bound_over_truth: float | None
    not_valid: int
    truth_n_m3: int

    @property
    def all_strides(self) -> int:
        return self.strides + self.bounds + self.not_valid


@dataclass(frozen=True)
class PlateRow:
    """How the lean of the flipper's plate explains the difference to the paper's upright plate."""

    setup: str
    mud: str
    coefficient: str
    upright_over_leaning: float
    estimate_over_upright: float | None
    lean_fraction: float | None = field(metadata={"key": "lean_share"})


def error_rows(evaluations: Sequence[Evaluation]) -> list[ErrorRow]:
    """Return one row for each setup, mud, coefficient and method, in the order of their first evaluations."""
    return [_error_row(group) for group in _grouped(evaluations, lambda each: each[:4])]


def _grouped(evaluations: Sequence[Evaluation], key: Callable[[Evaluation], Key]) -> list[list[Evaluation]]:
    groups: dict[Key, list[Evaluation]] = {}
    for each in evaluations:
        groups.setdefault(key(each), []).append(each)
    return list(groups.values())


def _error_row(group: Sequence[Evaluation]) -> ErrorRow:
    values, bounds = [each for each in group if each.is_value], [each for each in group if each.is_bound]
    ratios = np.array([each.estimate.value / each.truth for each in values])
    errors = np.abs(ratios - 1.0)
    covered = [abs(each.estimate.value - each.truth) <= NORMAL_95 * each.estimate.std_error for each in values]
    right = [each.estimate.value - NORMAL_95 * each.estimate.std_error <= each.truth for each in bounds]
    first = group[0]
    return ErrorRow(
        setup=first.setup,
        mud=first.mud,
        coefficient=first.coefficient,
        method=first.method,
        median=_rounded(np.median(errors)) if values else None,
        p95=_rounded(np.percentile(errors, 95.0)) if values else None,
        bias=_rounded(np.median(ratios) - 1.0) if values else None,
        coverage=_rounded(np.mean(covered)) if values else None,
        strides=len(values),
        bounds=len(bounds),
        bounds_hold=_rounded(np.mean(right)) if bounds else None,
        bound_over_truth=_rounded(np.median([b.estimate.value / b.truth for b in bounds])) if bounds else None,
        not_valid=len(group) - len(values) - len(bounds),
        truth_n_m3=round(float(np.median([each.truth for each in group]))),
    )


def plate_rows(evaluations: Sequence[Evaluation]) -> list[PlateRow]:
    """Compare the default method's estimates with both plates, for setups without a changed disturbance."""
    own = [each for each in evaluations if each.method == "default" and isfinite(each.upright)]
    return [_plate_row(group) for group in _grouped(own, lambda each: each[:3]) if "without" not in group[0].setup]


def _plate_row(group: Sequence[Evaluation]) -> PlateRow:
    first, values = group[0], [each for each in group if each.is_value]
    leaning = float(np.median([each.truth / each.upright for each in group]))
    estimate = float(np.median([each.estimate.value / each.upright for each in values])) if values else None
    return PlateRow(
        setup=first.setup,
        mud=first.mud,
        coefficient=first.coefficient,
        upright_over_leaning=_rounded(1.0 / leaning),
        estimate_over_upright=None if estimate is None else _rounded(estimate),
        lean_fraction=None if estimate is None else _rounded(_lean_fraction(leaning - 1.0, estimate - leaning)),
    )


def _lean_fraction(lean: float, error: float) -> float:
    """Return the lean's fraction of the sizes of two differences, which may cancel each other."""
    both = abs(lean) + abs(error)
    return abs(lean) / both if both > 0.0 else 0.0


def _rounded(value: Any) -> float:
    return round(float(value), 4)
