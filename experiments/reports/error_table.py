"""From single estimates beside their truth to a table: errors, coverage, and what the plate's lean has to do with it.

An estimate that is only a lower bound has no error: bounds are counted apart, with the share of them that hold. The
error is |estimate / truth - 1|, its 95 % interval the estimate give or take 1.96 standard errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from control.records import Estimate

COEFFICIENTS = ("k_p", "k_s", "k_e")
NORMAL_95 = 1.96


class Evaluation(NamedTuple):
    """One coefficient of one stride, by one method, beside the truth in N/m³."""

    setup: str
    mud: str
    coefficient: str
    method: str
    estimate: Estimate
    truth: float
    upright: float  # what the paper's load cell would have read


def error_rows(evaluated: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """One row for each setup, mud, coefficient and method, in the order in which they first came."""
    groups: dict[tuple[str, str, str, str], list[Evaluation]] = {}
    for each in evaluated:
        groups.setdefault(each[:4], []).append(each)
    return [
        dict(zip(("setup", "mud", "coefficient", "method"), key, strict=True)) | _errors(group)
        for key, group in groups.items()
    ]


def _errors(group: Sequence[Evaluation]) -> dict[str, Any]:
    values = [each for each in group if _is_value(each)]
    bounds = [each for each in group if each.estimate.valid and each.estimate.at_least]
    ratios = np.array([each.estimate.value / each.truth for each in values])
    errors = np.abs(ratios - 1.0)
    return {
        "median": _rounded(np.median(errors)) if values else None,
        "p95": _rounded(np.percentile(errors, 95.0)) if values else None,
        "bias": _rounded(np.median(ratios) - 1.0) if values else None,
        "coverage": _rounded(np.mean([_covers(each) for each in values])) if values else None,
        "strides": len(values),
        "bounds": len(bounds),
        "bounds_hold": _rounded(np.mean([_holds(each) for each in bounds])) if bounds else None,
        "bound_over_truth": _rounded(np.median([b.estimate.value / b.truth for b in bounds])) if bounds else None,
        "not_valid": len(group) - len(values) - len(bounds),
        "truth_n_m3": round(float(np.median([each.truth for each in group]))),
    }


def _is_value(each: Evaluation) -> bool:
    return each.estimate.valid and not each.estimate.at_least


def _covers(each: Evaluation) -> bool:
    return abs(each.estimate.value - each.truth) <= NORMAL_95 * each.estimate.std_error


def _holds(each: Evaluation) -> bool:
    return each.estimate.value - NORMAL_95 * each.estimate.std_error <= each.truth


def plate_rows(evaluated: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """How the paper's upright plate differs, and what of the default's difference from it is the plate's lean."""
    groups: dict[tuple[str, str, str], list[Evaluation]] = {}
    for each in evaluated:
        if each.method == "default" and isfinite(each.upright):
            groups.setdefault(each[:3], []).append(each)
    return [
        dict(zip(("setup", "mud", "coefficient"), key, strict=True)) | _plates(group)
        for key, group in groups.items()
        if "without" not in key[0]
    ]


def _plates(group: Sequence[Evaluation]) -> dict[str, Any]:
    reported = [each for each in group if _is_value(each)]
    leaning = float(np.median([each.truth / each.upright for each in group]))
    estimate = float(np.median([each.estimate.value / each.upright for each in reported])) if reported else None
    return {
        "upright_over_leaning": _rounded(1.0 / leaning),
        "estimate_over_upright": None if estimate is None else _rounded(estimate),
        "lean_share": None if estimate is None else _rounded(_lean_fraction(leaning - 1.0, estimate - leaning)),
    }


def _lean_fraction(lean: float, error: float) -> float:
    """Of the two parts of a difference, which may cancel: the lean's among their sizes."""
    both = abs(lean) + abs(error)
    return abs(lean) / both if both > 0.0 else 0.0


def _rounded(value: Any) -> float:
    return round(float(value), 4)
