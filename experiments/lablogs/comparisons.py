"""Estimates of one method that must agree: of both flippers, of neighbouring strides, of a log and its disturbed runs.

Both flippers of a walk are in the same mud, so their difference is explained by their errors: the median size of a
normal deviation is 0.67. A bound says that the mud is at least so strong, so the strides next to it may not be weaker.
A stride of a disturbed log is compared with the one of the same flipper that begins at the same time.
"""

from typing import Any

import numpy as np
import pandas
from pandas import DataFrame

from control.records import COEFFICIENTS, FLIPPERS
from experiments.lablogs.estimates import DISTURBED, MISSING, RECORDED, has_error

CONTRADICTING = 2.0  # standard errors
SAME_START_S = 0.2  # missing rows move the start of a stride by a few rows, and a stride takes more than a second
MOVED = 2.0  # claimed errors
ALL = "all"
KEYS = ["log", "flipper", "coefficient"]
KINDS = {"values": "value", "bounds": "bound", "invalid": "invalid"}


def count_kinds(estimates: DataFrame) -> dict[str, int]:
    """Count the estimates by what they are."""
    found = estimates["kind"].value_counts()
    return {name: int(found.get(kind, 0)) for name, kind in KINDS.items()}


def flipper_pairs(recorded: DataFrame) -> DataFrame:
    """Return the strides of walks in which both flippers have a value; both begin with the same sample."""
    walked = recorded[~recorded["fixed_base"].astype(bool) & has_error(recorded)]
    left, right = (walked[walked["flipper"] == name] for name in FLIPPERS)
    pairs = left.merge(right, on=["log", "t_start_s", "coefficient"], suffixes=("_left", "_right"))
    errors = np.hypot(pairs["repeatability_left"], pairs["repeatability_right"])
    return pairs.assign(difference=(pairs["value_left"] - pairs["value_right"]) / errors)


def agreements(pairs: DataFrame) -> dict[str, dict[str, Any]]:
    """Return the differences of both flippers over their claimed errors, by coefficient and of all together.

    The root mean square and the largest show the tails that a median hides.
    """
    sizes = pairs["difference"].abs()
    by_name = {name: sizes[pairs["coefficient"] == name] for name in COEFFICIENTS} | {ALL: sizes}
    return {
        name: _rounded(median=own.median(), rms=float(np.sqrt((own**2).mean())), largest=own.max()) | {"n": len(own)}
        for name, own in by_name.items()
    }


def contradictions(recorded: DataFrame) -> dict[str, int]:
    """Count the bounds on k_e, those with a value of the same flipper next to them, and those above such a value."""
    own = recorded[recorded["coefficient"] == "k_e"]
    strides = own.groupby(["log", "flipper", "walk"])[["value", "repeatability", "kind"]]
    bound = own["kind"] == "bound"
    neighbouring, above = ~bound & bound, ~bound & bound
    for neighbour in (strides.shift(1), strides.shift(-1)):
        known = bound & (neighbour["kind"] == "value")
        margin = CONTRADICTING * np.hypot(own["repeatability"], neighbour["repeatability"])
        neighbouring |= known
        above |= known & (own["value"] - neighbour["value"] > margin)
    return {"bounds": int(bound.sum()), "with_neighbour": int(neighbouring.sum()), "contradicting": int(above.sum())}


def disturbed_values(estimates: DataFrame) -> DataFrame:
    """Return every recorded value with the estimate of the same stride from each disturbed run.

    `ratio` is the disturbed over the recorded value, `moved_errors` the change in claimed errors; both are NaN where
    the value became invalid or a bound.
    """
    ordered = estimates.sort_values("t_start_s")
    values = ordered[(ordered["disturbance"] == RECORDED) & (ordered["kind"] == "value")]
    found = pandas.concat([_same_strides(values, ordered, *run) for run in DISTURBED], ignore_index=True)
    other = found["value_disturbed"].where(found["kind_disturbed"] == "value")
    errors = found["repeatability"].where(has_error(found))
    return found.assign(
        ratio=other / found["value"].where(found["value"] != 0.0),
        moved_errors=(other - found["value"]).abs() / errors,
    )


def _same_strides(values: DataFrame, estimates: DataFrame, disturbance: str, seed: int) -> DataFrame:
    run = estimates[(estimates["disturbance"] == disturbance) & (estimates["seed"] == seed)]
    return pandas.merge_asof(
        values.drop(columns=["disturbance"]),
        run[[*KEYS, "t_start_s", "value", "kind"]],
        on="t_start_s",
        by=KEYS,
        tolerance=SAME_START_S,
        direction="nearest",
        suffixes=("", "_disturbed"),
    ).assign(disturbance=disturbance)


def sensitivity(changes: DataFrame) -> dict[str, dict[str, dict[str, Any]]]:
    """Return the effect of each disturbance, by coefficient: the ratios, or what moved by more than MOVED errors."""
    return {run: {name: _effect_of(changes, run, name) for name in COEFFICIENTS} for run in dict(DISTURBED)}


def _effect_of(changes: DataFrame, run: str, coefficient: str) -> dict[str, Any]:
    own = changes[(changes["disturbance"] == run) & (changes["coefficient"] == coefficient)]
    known = own["moved_errors" if run == MISSING else "ratio"].dropna()
    if run == MISSING:
        found = _rounded(moved=(known > MOVED).mean())
    else:
        found = _rounded(median=known.median(), smallest=known.min(), largest=known.max())
    return found | {"n": len(known), "lost": len(own) - len(known)}


def _rounded(**values: float) -> dict[str, Any]:
    return {name: None if np.isnan(value) else round(float(value), 4) for name, value in values.items()}
