"""Evaluates the recorded trials of a load cell: coefficients of each mud with their errors, tables and figures."""

import json
from collections.abc import Mapping, Sequence
from functools import partial
from math import hypot, isfinite
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np
from pandas import DataFrame

from control.records import COEFFICIENTS
from drivers.load_cell.calibration import LoadCellCalibration
from experiments.loadcell.analysis import (
    CALLIPERS_M,
    MudCoefficient,
    analyse,
    bench_uncertainty,
    gather_trials,
    speed_remark,
)
from experiments.loadcell.plots import draw_coefficients, draw_mud
from experiments.loadcell.recording import load_counted
from experiments.loadcell.stage import TrialPlan
from experiments.loadcell.stage_track import common_alignment
from experiments.loadcell.strokes import INSERTION, RATE_EXPONENT, AnalysedTrial, StageSettings
from experiments.reports.mud_names import file_part, mud_key, mud_text
from experiments.reports.value_text import coefficient_text, miss_text, repeatability_text, value_text
from experiments.study.notebook import Notebook
from experiments.study.option import OptionError
from experiments.study.result import Figure, Result, Table, to_json
from experiments.study.session import Show
from experiments.trials.load_cell_truth import OTHER_PLATE, Truth

TITLE = "Ground truth of mud from a load cell"
ACCURACY = "docs/explanation/bench_accuracy.md"
METHOD = (
    "A plate on a load cell is dragged through the mud, and in other trials lowered, held and lifted (the paper's "
    "section II-E). k_p and k_e are fitted by F = k V over the way down and over the last three quarters of the way "
    "up, V being the submerged volume; k_s by F = k ∫ζ dA to the mean over the second half of the drag."
)
UNCONNECTED = "The stage has no encoder: its motion is found from the force, as that of a stage of one speed."
MEASURED = (
    "An encoder measured the stage's position: depths count from the surface that the force shows, and samples at rest "
    "do not count. The coefficients are those at the set speed."
)
FITTED = "measured (solid, one colour a trial) and modelled with the mud's coefficients (dashed)."
HEADING = "Coefficients ± one standard error of the trials ± one of the bench"
COMPARED = "Flipper and load cell"
TRUTH = "The same plate in even motion, without stage, cell and noise"
TRIAL_KEYS = ("speed_m_s", "is_measured", "alignment", "problem", "remark")
UNITS = dict.fromkeys(COEFFICIENTS, "N/cm³") | {"flipper": "N/cm³", "load cell": "N/cm³", "speed": "m/s"}
Muds = Mapping[str, Mapping[str, MudCoefficient]]  # by mud and coefficient


class Results(NamedTuple):
    trials: list[AnalysedTrial]
    muds: Muds
    remarks: list[str]


def evaluate_muds(folder: Path, notebook: Notebook, plan: TrialPlan, show: Show) -> Results:
    """Evaluate the recorded trials of a folder."""
    trials = analyse(load_counted(folder, notebook, plan.settings), show)
    muds: dict[str, dict[str, MudCoefficient]] = {}
    for mud in dict.fromkeys(trial.recorded.mud for trial in trials):
        own, muds[mud] = [trial for trial in trials if trial.recorded.mud == mud], {}
        calibrations = [notebook.entries[trial.recorded.key]["calibration"] for trial in own]
        calibration_error = max(LoadCellCalibration(**calibration).relative_error for calibration in calibrations)
        is_measured = all(trial.is_measured for trial in own if trial.coefficients)
        for name in COEFFICIENTS:  # a shear keeps the depth that the operator set
            depth_error_m = 0.0 if is_measured and name != "k_s" else plan.depth_error_m
            bench = bench_uncertainty(name, plan.settings, depth_error_m, calibration_error)
            muds[mud][name] = gather_trials(own, name, bench)
    return Results(trials, muds, list_remarks(trials))


def list_remarks(trials: Sequence[AnalysedTrial]) -> list[str]:
    remarks = [f"{trial.recorded.key}: {text}" for trial in trials for text in (trial.problem, trial.remark) if text]
    by_trial = {trial.recorded.key: remark for trial in trials if (remark := speed_remark(trial))}
    if len(by_trial) > 3:
        remarks.append(f"in {len(by_trial)} trials {next(iter(by_trial.values()))}")
    else:
        remarks += [f"{key}: {remark}" for key, remark in by_trial.items()]
    turned = sum(trial.profile.turned for trial in trials)
    if turned:
        remarks.append(f"in {turned} trials the cell measured with the opposite sign; their forces are turned")
    return remarks


def make_result(
    results: Results,
    notebook: Notebook,
    plan: TrialPlan,
    cell: Mapping[str, Any],
    flipper: Mapping[str, Any],
    truths: Mapping[str, Truth],
) -> Result:
    """Return the tables and figures. `truths` are those of simulated muds; `flipper` is a summary, or empty."""
    muds, compared = results.muds, compare_muds(flipper, results.muds)
    tables = [_coefficient_table(muds)]
    caption = "Mean of the trials with two standard errors; grey: every trial."
    figures = [Figure("coefficients", caption, partial(draw_coefficients, muds), "Coefficients")]
    texts = {"Coefficients": "\n\n".join([METHOD, *position_texts(results.trials), _errors_text(muds, plan)])}
    if compared:
        section = "Compared with the flipper"
        tables.append(Table("compared", COMPARED, UNITS, DataFrame(map(_comparison_row, compared)), section))
        texts[section] = _comparison_text(flipper, plan.settings)
    if truths:
        tables.append(_truth_table(muds, truths))
    for mud, coefficients in muds.items():
        own, section = [trial for trial in results.trials if trial.recorded.mud == mud], f"Mud {mud_text(mud)}"
        rows = DataFrame([_trial_row(trial) for trial in own])
        rows = rows.loc[:, ~rows.isin(["", "-"]).all()]
        tables.append(Table(f"trials {mud}", "", UNITS, rows, section, on_page_only=True))
        name, draw = f"mud_{file_part(mud)}", partial(draw_mud, own, coefficients, plan.settings)
        figures.append(Figure(name, f"{section}: {FITTED}", draw, section))
    return Result(
        tables=tables,
        figures=figures,
        summary=_summary(results, notebook, plan, cell) | {"compared": compared, "truth": truths},
        title=TITLE,
        texts=texts,
        notes=results.remarks,
    )


def _summary(results: Results, notebook: Notebook, plan: TrialPlan, cell: Mapping[str, Any]) -> dict[str, Any]:
    paces = [trial.pace for trial in results.trials if trial.pace is not None]
    return {
        "settings": to_json(plan.settings) | {"depth_error_m": plan.depth_error_m},
        "cell": cell,
        "stage": {
            name: fmean(getattr(pace, name) for pace in paces) if paces else None
            for name in ("speed_m_s", "acceleration_m_s2")
        },
        "muds": [
            {"mud": mud} | {name: each._asdict() | {"std_error": each.std_error} for name, each in coefficients.items()}
            for mud, coefficients in results.muds.items()
        ],
        "trials": [
            {"key": trial.recorded.key, **notebook.entries[trial.recorded.key], **trial.coefficients}
            | {name: getattr(trial, name) for name in TRIAL_KEYS}
            | {"place_error_m": trial.position_error_m if trial.is_measured else None}
            for trial in results.trials
        ],
        "left_out": notebook.left_out,
        "remarks": results.remarks,
    }


# tables


def _coefficient_table(muds: Muds) -> Table:
    rows = []
    for mud, coefficients in muds.items():
        rows.append({"mud": mud_text(mud)})
        for name, each in coefficients.items():
            rows[-1][name] = coefficient_text(each.value, each.trials_error, each.shared_error)
            rows[-1][f"repeatability of {name}"] = repeatability_text(each.repeatability, len(each.trials))
    return Table("coefficients", HEADING, UNITS, DataFrame(rows), "Coefficients")


def _comparison_row(row: Mapping[str, Any]) -> dict[str, str]:
    bound = "≥ " if row["at_least"] else ""
    return {
        "mud": mud_text(row["mud"]),
        "": row["coefficient"],
        "flipper": coefficient_text(row["sensed"], row["sensed_std_error"], at_least=row["at_least"]),
        "load cell": coefficient_text(row["truth"], row["truth_std_error"]),
        "flipper / load cell": bound + value_text(row["ratio"], row["ratio_std_error"]),
    }


def _truth_table(muds: Muds, truths: Mapping[str, Truth]) -> Table:
    rows = []
    for mud, coefficients in muds.items():
        true = truths[mud]
        rows.append({"mud": mud_text(mud)} | {name: coefficient_text(true[name]) for name in COEFFICIENTS})
        rows[-1] |= {f"{name} error": miss_text(coefficients[name].value, true[name]) for name in COEFFICIENTS}
    return Table("truth", TRUTH, UNITS, DataFrame(rows), "The simulated muds themselves")


def _trial_row(trial: AnalysedTrial) -> dict[str, Any]:
    row: dict[str, Any] = {"trial": f"{trial.recorded.kind} {trial.recorded.number}"}
    for name in COEFFICIENTS:
        estimate = trial.coefficients.get(name)
        row[name] = "" if estimate is None else coefficient_text(estimate.value, estimate.std_error)
    row["speed"] = "-" if trial.speed_m_s is None or not isfinite(trial.speed_m_s) else f"{trial.speed_m_s:.3f}"
    row["measured (cm)"] = "-"  # the depth of an insertion, or the travel of a shear
    if trial.positions_m is not None:
        farthest_m = float(np.nanmax(trial.positions_m))
        row["measured (cm)"] = value_text(100.0 * farthest_m, 100.0 * trial.position_error_m)
    return row | {"remark": trial.problem or trial.remark}


def load_flipper(path: Path) -> dict[str, Any]:
    """Read the summary of a flipper experiment, or the one in a folder. Raises OptionError, OSError."""
    path = path / "summary.json" if path.is_dir() else path
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as problem:
        raise OptionError(f"{path} is no summary of an experiment: {problem}") from problem
    if not isinstance(summary, dict) or not isinstance(summary.get("muds"), list):
        raise OptionError(f"{path} has no muds: give the summary.json of `mudskipper experiment flipper`")
    return summary


def compare_muds(flipper: Mapping[str, Any], muds: Mapping[str, Mapping[str, MudCoefficient]]) -> list[dict[str, Any]]:
    """Return a row for each coefficient that both measured, in N/m³. `flipper` is a summary, or empty."""
    sensed = {mud_key(str(row.get("mud"))): row for row in flipper.get("muds", ()) if isinstance(row, dict)}
    rows = []
    for mud, name, truth in ((mud, name, each) for mud, of_mud in muds.items() for name, each in of_mud.items()):
        estimate: Any = sensed.get(mud_key(mud), {}).get(name)
        value = estimate.get("value") if isinstance(estimate, dict) else None
        if isinstance(value, int | float) and value > 0.0 and isfinite(truth.value):
            error, ratio = estimate.get("std_error") or 0.0, value / truth.value
            rows.append(
                {
                    "mud": mud,
                    "coefficient": name,
                    "sensed": value,
                    "sensed_std_error": error,
                    "truth": truth.value,
                    "truth_std_error": truth.std_error,
                    "at_least": bool(estimate.get("at_least")),  # the flipper's value is a lower bound
                    "ratio": ratio,
                    "ratio_std_error": ratio * hypot(error / value, truth.std_error / truth.value),
                }
            )
    return rows


# texts


def position_texts(trials: Sequence[AnalysedTrial]) -> list[str]:
    """Explain how the position was measured, or that it was not."""
    measured = [trial for trial in trials if trial.is_measured]
    aligned = [trial.alignment for trial in measured if trial.alignment is not None]
    insertions = [trial for trial in measured if trial.recorded.kind == INSERTION]
    if not measured:
        return [UNCONNECTED]
    if not aligned or not insertions:
        return [MEASURED]
    common, worst_m = common_alignment(aligned), max(trial.position_error_m for trial in insertions)
    without = len(trials) - len(measured)
    alone = f" {without} trials have no measured position: it is found from the force." if without else ""
    return [
        f"{MEASURED}{alone}",
        f"Forces are stamped {1000.0 * common.lag_s:.1f} ± {1000.0 * common.lag_uncertainty_s:.1f} ms later than "
        "positions, as the strokes themselves show. With this and the interpolation of the encoder's lines, the depth "
        f"of a sample is known within ± {1000.0 * worst_m:.2f} mm in the worst trial. At twice the speed mud resists "
        f"{100.0 * common.rate_fraction * (2.0**RATE_EXPONENT - 1.0):.0f} % more.",
    ]


def _errors_text(muds: Muds, plan: TrialPlan) -> str:
    """Explain the two errors of each value."""
    fractions = []
    for name in COEFFICIENTS:
        errors = [mud[name].shared_error / mud[name].value for mud in muds.values() if isfinite(mud[name].value)]
        fractions.append(f"{100.0 * max(errors, default=0.0):.1f} % of {name}")
    return (
        "The first ± is one standard error of the trials. The second ± is alike in all trials: depth "
        f"± {1000.0 * plan.depth_error_m:g} mm (--depth-error), callipers ± {1000.0 * CALLIPERS_M:g} mm on width and "
        f"thickness, and the reading of the calibration, together at most {', '.join(fractions)}. k is the "
        f"least-squares fit to the mud's own curve and belongs to its depth; {ACCURACY} explains both errors."
    )


def _comparison_text(flipper: Mapping[str, Any], settings: StageSettings) -> str:
    depth_m = (flipper.get("settings") or {}).get("depth_m")
    if not isinstance(depth_m, int | float) or abs(depth_m - settings.depth_m) <= 1e-6:
        return OTHER_PLATE
    return (
        f"{OTHER_PLATE}\n\nThe flipper went {100.0 * depth_m:g} cm deep and the load cell "
        f"{100.0 * settings.depth_m:g} cm: coefficients of one mud differ with the depth, so these cannot be compared."
    )
