"""Coefficients of muds over several trials, compared with a load cell's: the records of a summary, and its tables.

Two standard errors contain the truth in about 19 of 20 cases. Muds that one robot measured are compared by the error
of the trials alone, since the shared error moves all of them alike.

A mud whose trials report more lower bounds than values has a bound as well (`at_least`): the median of all trials. The
few trials in which such a mud yielded met less resistance, or pushed harder, than anybody knows.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, isfinite, sqrt
from statistics import fmean, median, stdev
from typing import Any, NamedTuple

from pandas import DataFrame

from control.records import UNKNOWN, Estimate
from estimation.strokes.origin_fit import student_factor
from estimation.strokes.stroke_fit import TORQUE_REPEATABILITY
from experiments.reports.error_table import COEFFICIENTS, Row, error_rows, evaluation_of
from experiments.reports.mud_names import mud_text
from experiments.reports.value_text import N_CM3, fraction_text, repeatability_text, value_text

PER_CM3 = 1.0 / N_CM3
EstimateReport = Mapping[str, Any]  # an estimate as the daemon reports it: value, std_error, valid, at_least, ...


class ComparedStride(NamedTuple):
    """The estimates of one stride by one method, and a load cell's readings in N/m³."""

    mud: str  # empty where it is not certain
    method: str
    stride: Mapping[str, Any]
    truth: Mapping[str, float | None]
    trial: int = 0  # of a walk over several muds
    plates_m: float = UNKNOWN  # in such a walk, from the start of the first mud


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


@dataclass(frozen=True)
class MudSummary:
    """All coefficients of one mud, and a load cell's."""

    mud: str
    k_p: GatheredCoefficient
    k_s: GatheredCoefficient
    k_e: GatheredCoefficient
    truth: Mapping[str, float] | None

    def coefficient(self, name: str) -> GatheredCoefficient:
        gathered: GatheredCoefficient = getattr(self, name)
        return gathered


def gather_coefficient(estimates: Iterable[EstimateReport]) -> GatheredCoefficient:
    """Combine the trials of one coefficient in one mud."""
    reports = list(estimates)
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


def gather_coefficients(strides: Sequence[Mapping[str, Any]]) -> dict[str, GatheredCoefficient]:
    """Combine the strides of all trials, coefficient by coefficient."""
    return {name: gather_coefficient(stride[name] for stride in strides) for name in COEFFICIENTS}


def _errors(values: Sequence[EstimateReport], spread: float | None) -> tuple[float | None, float | None, float | None]:
    """Return the standard error, and its parts from the trials and shared by them; bounds have none."""
    if spread is None or not values:
        return (values[0]["std_error"] if values else None), None, None
    known = [error for each in values if (error := each["std_error"]) is not None and isfinite(error)]
    estimated = fmean(error**2 for error in known) if known else 0.0
    trials_error = student_factor(len(values) - 1) * spread / sqrt(len(values))
    alike = TORQUE_REPEATABILITY * fmean(each["value"] for each in values)
    shared_error = max(sqrt(max(0.0, estimated - spread**2)), alike)
    return hypot(trials_error, shared_error), trials_error, shared_error


def error_table(rows: Iterable[ComparedStride], setup: str) -> list[Row]:
    """Evaluate every coefficient that has a true value."""
    evaluations = [
        evaluation_of(setup, row.mud, name, row.method, estimate_of(row.stride[name]), float(truth), UNKNOWN)
        for row in rows
        for name in COEFFICIENTS
        if (truth := row.truth.get(name)) is not None and row.stride[name] is not None
    ]
    return error_rows(DataFrame(evaluations))


def estimate_of(report: EstimateReport) -> Estimate:
    value, std_error = (UNKNOWN if report[name] is None else float(report[name]) for name in ("value", "std_error"))
    return Estimate(value, std_error, report["samples"], report["valid"], report["reason"], report["at_least"])


# tables for people


def coefficient_text(gathered: GatheredCoefficient) -> str:
    """Format in N/cm³, with the errors of the trials and the shared one, or the one error of a single trial."""
    if gathered.value is None:
        return "-"
    errors = (gathered.trials_error, gathered.shared_error)
    errors = (gathered.std_error, None) if gathered.trials_error is None else errors
    text = value_text(gathered.value, *errors, per=N_CM3)
    return f"≥ {text}" if gathered.at_least else text


def mud_rows(muds: Sequence[MudSummary]) -> list[list[str]]:
    """List each mud's coefficients with their repeatability and the load cell's."""
    head = ["mud"]
    for name in COEFFICIENTS:
        head += [f"{name} (N/cm³)", "repeatability", "load cell"]
    return [head, *([mud_text(mud.mud), *_mud_cells(mud)] for mud in muds)]


def _mud_cells(mud: MudSummary) -> list[str]:
    cells = []
    for name in COEFFICIENTS:
        gathered = mud.coefficient(name)
        cells += [coefficient_text(gathered), repeatability_text(gathered.repeatability, len(gathered.trials))]
        cells.append(value_text((mud.truth or {}).get(name), per=N_CM3))
    return cells


def error_text_rows(errors: Sequence[Row]) -> list[list[str]]:
    """List the median error of each coefficient by mud and method, mud by mud."""
    head = ["mud", "method", *(f"{name} error" for name in COEFFICIENTS), "strides"]
    muds = list(dict.fromkeys(row["mud"] for row in errors))
    keys = sorted(dict.fromkeys((row["mud"], row["method"]) for row in errors), key=lambda key: muds.index(key[0]))
    rows = [head]
    for key in keys:
        own = {row["coefficient"]: row for row in errors if (row["mud"], row["method"]) == key}
        cells = [_error_text(own[name]) if name in own else "-" for name in COEFFICIENTS]
        rows.append(
            [
                mud_text(key[0]),
                key[1],
                *cells,
                str(max(row["strides"] + row["bounds"] + row["not_valid"] for row in own.values())),
            ]
        )
    return rows


def _error_text(row: Row) -> str:
    median, bias, bounds, lost = (row[name] for name in ("median", "bias", "bounds", "not_valid"))
    parts = [] if median is None else [f"{fraction_text(median)} ({100.0 * bias:+z.0f} %)"]
    if bounds:
        parts.append(f"≥ {100.0 * row['bound_over_truth']:.0f} % of it ({bounds})")
    if lost:
        parts.append(f"nothing ({lost})")
    return ", ".join(parts) or "-"
