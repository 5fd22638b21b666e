"""Errors of estimated coefficients against their true values, by setup, mud, coefficient and method.

The error of an estimate is |estimate / truth - 1|, and its 95 % interval reaches 1.96 standard errors to either side.
A lower bound has no error: bounds are counted apart, with the fraction of them that are right. `chi` compares the
scatter of the strides of one trial and flipper about their own mean with the repeatability that they claim: 1 is right,
and more is a claim that is too small. A second table compares the plate as the flipper carries it, leaning, with the
upright plate of the paper's load cell.
"""

from typing import Any

import numpy as np
from pandas import DataFrame

NORMAL_95 = 1.96
KEYS = ["setup", "mud", "coefficient", "method"]
SHOWN = ["median", "bias", "coverage", "strides", "bounds", "bounds_hold", "not_valid"]  # of many groups
Row = dict[str, Any]


def error_rows(evaluations: DataFrame) -> list[Row]:
    """Return one row for each setup, mud, coefficient and method, in the order of their first evaluations.

    An evaluation has these keys, an estimate with its `kind`, its `truth`, and the `trial` that strides share.
    """
    groups = evaluations.groupby(KEYS, sort=False) if len(evaluations) else ()
    return [dict(zip(KEYS, key, strict=True)) | _errors(group) for key, group in groups]


def error_frame(evaluations: DataFrame, *keys: str) -> DataFrame:
    """Return the errors of the groups that differ in these keys alone, pooled over the others."""
    pooled = evaluations.assign(**{key: "" for key in KEYS if key not in keys})
    return DataFrame(error_rows(pooled), columns=[*keys, *SHOWN])


def _errors(group: DataFrame) -> Row:
    """Return the errors of one method for one coefficient in one mud. None where there is no such estimate."""
    values, bounds = group[group["kind"] == "value"], group[group["kind"] == "bound"]
    ratios = values["value"] / values["truth"]
    margins, truths = NORMAL_95 * values["std_error"], group["truth"].dropna()
    bounds_hold = bounds["value"] - NORMAL_95 * bounds["std_error"] <= bounds["truth"]
    return {
        "median": _statistic(np.median, abs(ratios - 1.0)),
        "p95": _statistic(lambda errors: np.percentile(errors, 95.0), abs(ratios - 1.0)),
        "bias": _statistic(lambda each: np.median(each) - 1.0, ratios),  # median of estimate / truth - 1
        "coverage": _statistic(np.mean, abs(values["value"] - values["truth"]) <= margins),  # of the 95 % intervals
        "chi": _scatter_over_claim(values),
        "strides": len(values),
        "bounds": len(bounds),
        "bounds_hold": _statistic(np.mean, bounds_hold),  # fraction of bounds below the truth, within their errors
        "bound_over_truth": _statistic(np.median, bounds["value"] / bounds["truth"]),
        "not_valid": len(group) - len(values) - len(bounds),
        "truth_n_m3": round(float(np.median(truths))) if len(truths) else None,
    }


def _scatter_over_claim(values: DataFrame) -> float | None:
    """Return √(χ² / degrees of freedom) of the strides about the mean of their trial, in claimed repeatability."""
    known = values[values["repeatability"] > 0.0]
    errors = known["repeatability"] / known["value"]
    deviations, weights = np.log(known["value"] / known["truth"]), errors**-2.0
    sums = DataFrame({"trial": known["trial"], "weight": weights, "product": weights * deviations})
    means = sums.groupby("trial")["product"].transform("sum") / sums.groupby("trial")["weight"].transform("sum")
    freedom = len(known) - known["trial"].nunique()
    return round(float(np.sqrt(np.sum(weights * (deviations - means) ** 2) / freedom)), 3) if freedom > 0 else None


def _statistic(function: Any, values: Any) -> float | None:
    return round(float(function(values.to_numpy())), 4) if len(values) else None


def plate_rows(evaluations: DataFrame) -> list[Row]:
    """Compare the default method's estimates with both plates, for setups without a changed disturbance.

    A row says how the lean of the flipper's plate explains the difference to the paper's upright plate. The lean's
    fraction is of the sizes of two differences, which may cancel each other.
    """
    if not len(evaluations):
        return []
    own = evaluations[(evaluations["method"] == "default") & evaluations["upright"].notna()]
    own = own[~own["setup"].str.contains("without")]
    rows: list[Row] = []
    for key, group in own.groupby(KEYS[:3], sort=False):
        values, leaning = group[group["kind"] == "value"], float(np.median(group["truth"] / group["upright"]))
        row: Row = dict(zip(KEYS, key, strict=False)) | {"upright_over_leaning": round(1.0 / leaning, 4)}
        row |= {"estimate_over_upright": None, "lean_fraction": None}
        if len(values):
            estimate = float(np.median(values["value"] / values["upright"]))
            lean, both = abs(leaning - 1.0), abs(leaning - 1.0) + abs(estimate - leaning)
            row["estimate_over_upright"] = round(estimate, 4)
            row["lean_fraction"] = round(lean / both if both > 0.0 else 0.0, 4)
        rows.append(row)
    return rows
