"""Coefficients of muds over several trials, next to a load cell's: the rows of a data frame, their summary and tables.

A row is one coefficient of one stride by one method, with the load cell's reading. Two standard errors contain the
truth in about 19 of 20 cases. Muds that one robot measured are compared by the error of the trials alone, since the
shared error moves all of them alike.

A mud whose trials report more lower bounds than values has a bound as well (`at_least`): the median of all trials. The
few trials in which such a mud yielded met less resistance, or pushed harder, than anybody knows.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, isfinite, sqrt
from statistics import fmean, median, stdev
from typing import Any

from pandas import Categorical, DataFrame

from control.records import COEFFICIENTS
from estimation.strokes.origin_fit import student_factor
from estimation.strokes.stroke_fit import TORQUE_CONSTANT_UNCERTAINTY
from experiments.reports.error_table import Row, error_rows
from experiments.reports.mud_names import mud_text
from experiments.reports.value_text import coefficient_text, fraction_text, repeatability_text

EstimateReport = Mapping[str, Any]  # an estimate as the daemon reports it: value, std_error, valid, at_least, ...
NUMBERS = ["value", "std_error", "repeatability", "truth", "upright"]  # N/m³
COLUMNS = ["setup", "mud", "method", "trial", "t_start_s", "t_end_s", "plates_m", "coefficient", "kind", "valid",
           "at_least", "reason", *NUMBERS]  # fmt: skip


def compared_rows(
    stride: Mapping[str, Any], truth: Mapping[str, float | None], upright: Mapping[str, float | None] = {}, **keys: Any
) -> list[Row]:
    """Return the coefficients that a method reports of one stride, with a load cell's readings.

    The mud is empty where it is not certain. `upright` has the readings with the paper's plate.
    """
    keys |= {name: stride.get(name) for name in ("t_start_s", "t_end_s")}
    return [
        keys
        | dict(estimate)
        | {
            "coefficient": name,
            "kind": ("bound" if estimate["at_least"] else "value") if estimate["valid"] else "not valid",
            "truth": truth.get(name),
            "upright": upright.get(name),
        }
        for name in COEFFICIENTS
        if (estimate := stride[name]) is not None
    ]


def compared_frame(rows: Iterable[Row]) -> DataFrame:
    return DataFrame(list(rows), columns=COLUMNS).astype(dict.fromkeys(NUMBERS, float))


@dataclass(frozen=True)
class GatheredCoefficient:
    """One coefficient of one mud over its trials, in N/m³; None where nothing is known."""

    value: float | None  # mean over the trials with a value
    std_error: float | None  # of that mean, with every known error; of a single trial, its estimator's
    trials_error: float | None  # from the scatter of the trials, with Student's factor; None for a single one
    shared_error: float | None  # alike in all trials, at least that of a torque constant; None for a single one
    trials: Sequence[float]
    repeatability: float | None  # standard deviation of the trials over their mean; None for a single one
    at_least: bool  # the value is a lower bound
    bounds: int  # trials that report a lower bound
    not_valid: Sequence[str]  # why trials report nothing


def gather_coefficient(estimates: DataFrame | Iterable[EstimateReport]) -> GatheredCoefficient:
    """Combine the trials of one coefficient in one mud."""
    reports = estimates.to_dict("records") if isinstance(estimates, DataFrame) else list(estimates)
    valid = [each for each in reports if each["valid"]]
    bounds = sum(each["at_least"] for each in valid)
    at_least = 2 * bounds > len(valid)
    values = [] if at_least else [each for each in valid if not each["at_least"]]
    trials = [each["value"] for each in values or valid]
    spread = stdev(trials) if len(trials) > 1 else None
    std_error, trials_error, shared_error = _errors(values, spread)
    return GatheredCoefficient(
        value=(median(trials) if at_least else fmean(trials)) if trials else None,
        std_error=std_error,
        trials_error=trials_error,
        shared_error=shared_error,
        trials=trials,
        repeatability=spread / fmean(trials) if spread is not None and fmean(trials) else None,
        at_least=at_least,
        bounds=bounds,
        not_valid=[each["reason"] for each in reports if not each["valid"]],
    )


def mud_summaries(
    rows: DataFrame, muds: Iterable[str], method: str, average: Callable[[Sequence[float]], float]
) -> list[dict[str, Any]]:
    """Return each mud's name, coefficients by one method, and the average of the load cell's readings."""
    own = {mud: rows[(rows["mud"] == mud) & (rows["method"] == method)] for mud in muds}
    return [
        {"mud": mud}
        | {name: gather_coefficient(each[each["coefficient"] == name]) for name in COEFFICIENTS}
        | {"truth": average_truth(each, average) or None}
        for mud, each in own.items()
    ]


def average_truth(rows: DataFrame, average: Callable[[Sequence[float]], float]) -> dict[str, float]:
    """Return the average of the load cell's readings, by coefficient."""
    known = rows[rows["truth"].notna()].groupby("coefficient")["truth"]
    return {name: average(readings.tolist()) for name, readings in known}


def _errors(values: Sequence[EstimateReport], spread: float | None) -> tuple[float | None, float | None, float | None]:
    """Return the standard error, and its parts from the trials and shared by them; bounds have none."""
    known, own = (
        [error for each in values if (error := each.get(name)) is not None and isfinite(error)]
        for name in ("std_error", "repeatability")
    )
    if spread is None or not values:
        return (known[0] if known else None), None, None
    trials_error = student_factor(len(values) - 1) * spread / sqrt(len(values))
    alike, shared_variance = TORQUE_CONSTANT_UNCERTAINTY * fmean(each["value"] for each in values), 0.0
    if known:  # of logs without repeatability, what the trials' scatter leaves
        own_variance = fmean(error**2 for error in own) if len(own) == len(known) else spread**2
        shared_variance = max(0.0, fmean(error**2 for error in known) - own_variance)
    shared_error = max(sqrt(shared_variance), alike)
    return hypot(trials_error, shared_error), trials_error, shared_error


def error_table(rows: DataFrame, setup: str) -> list[Row]:
    """Evaluate every coefficient that has a true value."""
    return error_rows(rows[rows["truth"].notna()].assign(setup=setup))


# tables for people


def gathered_text(gathered: GatheredCoefficient) -> str:
    """Format in N/cm³, with the errors of the trials and the shared one, or the one error of a single trial."""
    errors = (gathered.trials_error, gathered.shared_error)
    errors = (gathered.std_error, None) if gathered.trials_error is None else errors
    return coefficient_text(gathered.value, *errors, at_least=gathered.at_least)


def mud_table(muds: Sequence[Mapping[str, Any]]) -> DataFrame:
    """Return each mud's coefficients with their repeatability and the load cell's."""
    rows = []
    for mud in muds:
        row = {"mud": mud_text(mud["mud"])}
        for name in COEFFICIENTS:
            gathered: GatheredCoefficient = mud[name]
            row[f"{name} (N/cm³)"] = gathered_text(gathered)
            row[f"{name} repeatability"] = repeatability_text(gathered.repeatability, len(gathered.trials))
            row[f"{name} load cell"] = coefficient_text((mud["truth"] or {}).get(name))
        rows.append(row)
    return DataFrame(rows)


def error_text_table(errors: Sequence[Row]) -> DataFrame:
    """Return the median error of each coefficient by mud and method, mud by mud."""
    frame = DataFrame(errors)
    for name in ("mud", "method"):
        frame[name] = Categorical(frame[name], categories=frame[name].unique())
    frame["text"] = [_error_text(row) for row in errors]
    frame["all"] = frame["strides"] + frame["bounds"] + frame["not_valid"]
    groups = frame.groupby(["mud", "method"], observed=True)
    texts = frame.set_index(["mud", "method", "coefficient"])["text"].unstack().reindex(columns=COEFFICIENTS)
    table = texts.astype(object).fillna("-").add_suffix(" error").assign(strides=groups["all"].max()).reset_index()
    return table.astype({"mud": str, "method": str}).assign(mud=lambda rows: rows["mud"].map(mud_text))


def _error_text(row: Row) -> str:
    median, bias, bounds, lost = (row[name] for name in ("median", "bias", "bounds", "not_valid"))
    parts = [] if median is None else [f"{fraction_text(median)} ({100.0 * bias:+z.0f} %)"]
    if bounds:
        parts.append(f"≥ {100.0 * row['bound_over_truth']:.0f} % of it ({bounds})")
    if lost:
        parts.append(f"nothing ({lost})")
    return ", ".join(parts) or "-"
