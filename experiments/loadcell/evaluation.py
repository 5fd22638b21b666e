"""Evaluates the recorded trials of a load cell: the coefficients of each mud with their errors, and the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import fsum
from pathlib import Path
from typing import Any, NamedTuple

from drivers.load_cell.calibration import LoadCellCalibration
from experiments.loadcell.analysis import (
    COEFFICIENTS,
    MudCoefficient,
    analyse,
    bench_uncertainty,
    gather_trials,
    speed_remark,
)
from experiments.loadcell.comparison import Compared, compare_muds
from experiments.loadcell.recording import load_counted
from experiments.loadcell.strokes import AnalysedTrial, StageSettings
from experiments.loadcell.trials import TrialPlan
from experiments.reports.report_page import to_json
from experiments.study.notebook import Entry, Notebook
from experiments.trials.session import Show

ALIGNMENT_KEYS = ("lag_s", "rate_share", "lag_doubt_s", "rate_doubt")  # as in earlier summaries


class Results(NamedTuple):
    trials: list[AnalysedTrial]
    muds: dict[str, dict[str, MudCoefficient]]  # by mud and coefficient
    remarks: list[str]
    compared: list[Compared]


@dataclass(frozen=True)
class LoadcellReport:
    settings: Mapping[str, float]
    cell: Mapping[str, Any]
    stage: Mapping[str, float | None]
    muds: Sequence[Mapping[str, Any]]
    trials: Sequence[Mapping[str, Any]]
    left_out: Mapping[str, Entry]
    remarks: Sequence[str]
    compared: Sequence[Mapping[str, Any]]
    truth: Mapping[str, Any]  # of simulated muds
    experiment: str = "loadcell"


def evaluate_muds(
    folder: Path, notebook: Notebook, plan: TrialPlan, flipper: Mapping[str, Any] | None, show: Show
) -> Results:
    """Evaluate the recorded trials of a folder."""
    trials = analyse(load_counted(folder, notebook), plan.settings, show)
    muds = {}
    for mud in dict.fromkeys(trial.recorded.mud for trial in trials):
        own = [trial for trial in trials if trial.recorded.mud == mud]
        errors = _bench_errors(own, notebook, plan)
        muds[mud] = {name: gather_trials(own, name, errors[name]) for name in COEFFICIENTS}
    return Results(trials, muds, list_remarks(trials, plan.settings), compare_muds(flipper, muds))


def _bench_errors(trials: Sequence[AnalysedTrial], notebook: Notebook, plan: TrialPlan) -> dict[str, float]:
    """Return the fraction by which the bench may err alike in all trials of a mud, by coefficient."""
    calibrations = [notebook.entries[trial.recorded.key]["calibration"] for trial in trials]
    calibration_error = max(LoadCellCalibration(**calibration).relative_error for calibration in calibrations)
    depth_errors_m = dict.fromkeys(COEFFICIENTS, plan.depth_error_m)
    if all(trial.is_measured for trial in trials if trial.coefficients):
        depth_errors_m |= {"k_p": 0.0, "k_e": 0.0}  # a shear keeps the depth that the operator set
    return {
        name: bench_uncertainty(name, plan.settings, depth_errors_m[name], calibration_error) for name in COEFFICIENTS
    }


def list_remarks(trials: Sequence[AnalysedTrial], settings: StageSettings) -> list[str]:
    remarks = [f"{trial.recorded.key}: {text}" for trial in trials for text in (trial.problem, trial.remark) if text]
    paced = [(trial.recorded.key, trial.pace) for trial in trials if trial.pace is not None]
    by_trial = {key: remark for key, pace in paced if (remark := speed_remark(pace, settings))}
    if len(by_trial) > 3:
        remarks.append(f"in {len(by_trial)} trials {next(iter(by_trial.values()))}")
    else:
        remarks += [f"{key}: {remark}" for key, remark in by_trial.items()]
    turned = fsum(trial.profile is not None and trial.profile.turned for trial in trials)
    if turned:
        remarks.append(f"in {turned} trials the cell measured with the opposite sign; their forces are turned")
    return remarks


def make_report(
    results: Results, notebook: Notebook, plan: TrialPlan, cell: Mapping[str, Any], truth: Mapping[str, Any]
) -> LoadcellReport:
    paces = [trial.pace for trial in results.trials if trial.pace is not None]
    return LoadcellReport(
        settings=to_json(plan.settings) | {"depth_error_m": plan.depth_error_m},
        cell=cell,
        stage={
            "speed_m_s": fsum(pace.speed_m_s for pace in paces) / len(paces) if paces else None,
            "acceleration_m_s2": fsum(pace.acceleration_m_s2 for pace in paces) / len(paces) if paces else None,
        },
        muds=[
            {"mud": mud} | {name: each._asdict() | {"std_error": each.std_error} for name, each in coefficients.items()}
            for mud, coefficients in results.muds.items()
        ],
        trials=[_trial_entries(trial, notebook.entries[trial.recorded.key]) for trial in results.trials],
        left_out=notebook.left_out,
        remarks=results.remarks,
        compared=[
            row._asdict() | {"ratio": row.ratio, "ratio_std_error": row.ratio_std_error} for row in results.compared
        ],
        truth=truth,
    )


def _trial_entries(trial: AnalysedTrial, entry: Entry) -> dict[str, Any]:
    """Join the notebook's entry of a trial and its results, by the names that programs read."""
    return {"key": trial.recorded.key, **entry, **trial.coefficients} | {
        "speed_m_s": trial.speed_m_s,
        "is_measured": trial.is_measured,
        "place_error_m": trial.position_error_m if trial.is_measured else None,
        "alignment": trial.alignment and dict(zip(ALIGNMENT_KEYS, trial.alignment, strict=True)),
        "problem": trial.problem,
        "remark": trial.remark,
    }
