"""The coefficients of muds, gathered over trials, and beside a load cell's: what summaries hold and tables show.

A summary has `muds`, a list of objects with the name of the mud and for each of k_p, k_s, k_e in N/m³:

    value          mean over the trials that gave a value
    std_error      of that mean, of everything that is known to err; of a single one, what its estimator doubts
    trials_error   the part of it that the trials' own scatter tells, with Student's factor; null for a single one
    shared_error   the part that all trials have alike: what their estimator doubts beyond their scatter, and at the
                   least that of a torque (the motors' constants); null for a single one
    trials         their values, one by one
    repeatability  their standard deviation over their mean; null for a single one

Two standard errors hold the truth in about 19 of 20 cases. Muds of one robot are told apart by the trials' part alone.

Where more trials tell a lower bound than a value the mud's is a bound as well (`at_least`), the middle one of all: the
few in which mud gave way that mostly holds are those that met less of it, or pushed harder, than anybody knows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import hypot, isfinite, sqrt
from statistics import fmean, median, stdev
from typing import Any, NamedTuple

from control.records import UNKNOWN, Estimate
from estimation.strokes.origin_fit import student_factor
from estimation.strokes.stroke_fit import TORQUE_REPEATABILITY
from experiments.reports.error_table import COEFFICIENTS, Evaluation, error_rows
from experiments.reports.mud_names import mud_text
from experiments.reports.value_text import N_CM3, fraction_text, repeatability_text, value_text

PER_CM3 = 1.0 / N_CM3
Reported = Mapping[str, Any]  # an estimate as reports tell it


class ComparedStride(NamedTuple):
    """One stride's estimates by one method, and what a load cell reads there."""

    mud: str
    method: str
    stride: Mapping[str, Any]
    truth: Mapping[str, float | None]


def gather_coefficient(estimates: Iterable[Reported]) -> dict[str, Any]:
    """Of one coefficient in one mud, over its trials."""
    reported = list(estimates)
    valid = [each for each in reported if each["valid"]]
    bounds = sum(each["at_least"] for each in valid)
    held = 2 * bounds > len(valid)
    values = [] if held else [each for each in valid if not each["at_least"]]
    trials = [each["value"] for each in values or valid]
    spread = stdev(trials) if len(trials) > 1 else None
    return {
        "value": (median(trials) if held else fmean(trials)) if trials else None,
        **_errors(values, spread),
        "trials": trials,
        "repeatability": spread / fmean(trials) if spread is not None and fmean(trials) else None,
        "at_least": held,
        "bounds": bounds,
        "not_valid": [each["reason"] for each in reported if not each["valid"]],
    }


def _errors(reported: Sequence[Reported], spread: float | None) -> dict[str, float | None]:
    """Of values; of bounds there is none. What a trial does not doubt in a number is left to the others."""
    if spread is None or not reported:
        return {"std_error": reported[0]["std_error"] if reported else None, "trials_error": None, "shared_error": None}
    uncertainties = [
        uncertainty for each in reported if (uncertainty := each["std_error"]) is not None and isfinite(uncertainty)
    ]
    doubted = fmean(uncertainty**2 for uncertainty in uncertainties) if uncertainties else 0.0
    trials_error = student_factor(len(reported) - 1) * spread / sqrt(len(reported))
    alike = TORQUE_REPEATABILITY * fmean(each["value"] for each in reported)
    shared_error = max(sqrt(max(0.0, doubted - spread**2)), alike)
    return {
        "std_error": hypot(trials_error, shared_error),
        "trials_error": trials_error,
        "shared_error": shared_error,
    }


def evaluated(rows: Iterable[ComparedStride], setup: str) -> list[Evaluation]:
    """One for each coefficient of which there is a truth."""
    return [
        Evaluation(setup, row.mud, name, row.method, estimate_of(row.stride[name]), float(truth), UNKNOWN)
        for row in rows
        for name in COEFFICIENTS
        if (truth := row.truth.get(name)) is not None and row.stride[name] is not None
    ]


def estimate_of(reported: Reported) -> Estimate:
    value, std_error = (UNKNOWN if reported[name] is None else float(reported[name]) for name in ("value", "std_error"))
    return Estimate(value, std_error, reported["samples"], reported["valid"], reported["reason"], reported["at_least"])


def error_table(rows: Iterable[ComparedStride], setup: str) -> list[dict[str, Any]]:
    return error_rows(evaluated(rows, setup))


# as words


def coefficient_text(row: Mapping[str, Any]) -> str:
    """Format a gathered coefficient in N/cm³, with its two parts of the error, or the one of a single trial."""
    if row["value"] is None:
        return "-"
    parts = ("std_error",) if row["trials_error"] is None else ("trials_error", "shared_error")
    reported = value_text(row["value"], *(row[part] for part in parts), per=N_CM3)
    return f"≥ {reported}" if row["at_least"] else reported


def mud_rows(muds: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A table with its head: each mud's coefficients, and the load cell's beside them where there is one."""
    head = ["mud"]
    for name in COEFFICIENTS:
        head += [f"{name} (N/cm³)", "repeatability", "load cell"]
    rows = [head]
    for mud in muds:
        cells = [mud_text(mud["mud"])]
        for name in COEFFICIENTS:
            truth = (mud.get("truth") or {}).get(name)
            cells += [
                coefficient_text(mud[name]),
                repeatability_text(mud[name]["repeatability"], len(mud[name]["trials"])),
            ]
            cells.append(value_text(truth, per=N_CM3))
        rows.append(cells)
    return rows


def error_text_rows(errors: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A table with its head: the median error of each coefficient by mud and method, muds one after the other."""
    head = ["mud", "method", *(f"{name} error" for name in COEFFICIENTS), "strides"]
    muds = list(dict.fromkeys(row["mud"] for row in errors))
    keys = sorted(dict.fromkeys((row["mud"], row["method"]) for row in errors), key=lambda key: muds.index(key[0]))
    rows = [head]
    for key in keys:
        own = {row["coefficient"]: row for row in errors if (row["mud"], row["method"]) == key}
        cells = [_error_text(own[name]) if name in own else "-" for name in COEFFICIENTS]
        rows.append([mud_text(key[0]), key[1], *cells, str(max(_strides(row) for row in own.values()))])
    return rows


def _strides(row: Mapping[str, Any]) -> int:
    return int(row["strides"] + row["bounds"] + row["not_valid"])


def _error_text(row: Mapping[str, Any]) -> str:
    """A bound is told as one, with its median share of the truth, and how many there were."""
    parts = []
    if row["median"] is not None:
        parts.append(f"{fraction_text(row['median'])} ({100.0 * row['bias']:+z.0f} %)")
    if row["bounds"]:
        parts.append(f"≥ {100.0 * row['bound_over_truth']:.0f} % of it ({row['bounds']})")
    if row["not_valid"]:
        parts.append(f"nothing ({row['not_valid']})")
    return ", ".join(parts) or "-"
