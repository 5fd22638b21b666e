"""The report of the single flipper's trials: coefficients by mud, their errors, the largest forces, and the misfit."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import nan
from statistics import fmean
from typing import Any

from pandas import DataFrame

from control.records import Phase
from experiments.flipper.measurement import FlipperTrials
from experiments.flipper.modelled_force import drawn_coefficients, misfit_n, modelled_forces
from experiments.reports.coefficient_table import compared_frame, compared_rows, error_table, mud_summaries
from experiments.reports.error_table import COEFFICIENTS
from experiments.study.notebook import Entry
from experiments.trials.estimation_methods import configured_method
from experiments.trials.stride_profile import profile_from_row
from experiments.trials.truth_file import TruthOfMud, truth_in, truth_settings
from firmware_host.configuration.configuration import Configuration

STROKES = {"insertion": Phase.INSERTION, "stance": Phase.STANCE, "extraction": Phase.EXTRACTION}
Report = dict[str, Any]  # the summary, as it is in JSON


def report_of(
    plan: FlipperTrials,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
    left_out: Mapping[str, Entry] | None = None,
) -> Report:
    """Report the trials that count. `truth` is another experiment's; without it the bed's own load cell is used."""
    method, geometry = configured_method(configuration.estimation), configuration.geometry
    by_mud = {mud: trials for mud in muds_of(plan, entries) if (trials := trials_of(mud, entries))}
    rows = compared_frame(  # the first stride of each trial
        row
        for mud, trials in by_mud.items()
        for trial in trials
        for name, strides in trial["strides"].items()
        for known in (truth_in(truth, mud) if truth else trial["truths"].get("0", {}),)
        for row in (compared_rows(strides[0], known, mud=mud, method=name) if strides else ())
    )
    muds = mud_summaries(rows, by_mud, method, fmean)
    remarks = {mud: [each for trial in trials for each in trial["remarks"]] for mud, trials in by_mud.items()}
    plate_m = {
        "width": geometry.plate.width_m,
        "height": geometry.plate.height_m,
        "thickness": geometry.plate_thickness_m,
    }
    return {
        "experiment": "flipper",
        "muds": [mud | {"remarks": remarks[mud["mud"]]} for mud in muds],
        "errors": error_table(rows, "single flipper"),
        "falls_with_water": {name: _falls_with_water(muds, name) for name in COEFFICIENTS},
        "largest_forces_n": {mud: _largest_forces_n(trials, method) for mud, trials in by_mud.items()},
        "misfit_n": {mud: _misfits_n(trials[0], configuration, method) for mud, trials in by_mud.items()},
        "later_strokes": _later_strokes(by_mud, method),
        "plate_m": plate_m,
        "left_out": left_out or {},
    } | truth_settings(plan.identity, method, truth, by_mud)


def muds_of(plan: FlipperTrials, entries: Mapping[str, Entry]) -> list[str]:
    return list(dict.fromkeys([*plan.muds, *(entry["mud"] for entry in entries.values())]))


def trials_of(mud: str, entries: Mapping[str, Entry]) -> list[Entry]:
    return sorted((entry for entry in entries.values() if entry["mud"] == mud), key=lambda entry: int(entry["trial"]))


def _falls_with_water(muds: Sequence[Mapping[str, Any]], name: str) -> bool | None:
    """Return whether the coefficient falls with water, as in the paper; None where the names are no water contents."""
    try:
        known = sorted((float(mud["mud"]), mud[name].value) for mud in muds if mud[name].value is not None)
    except ValueError:
        return None
    return all(drier > wetter for (_, drier), (_, wetter) in pairwise(known)) if len(known) > 1 else None


def _largest_forces_n(trials: Sequence[Entry], method: str) -> dict[str, float]:
    """Average the largest forces of the first strides by stroke; NaN where there are none."""
    firsts = DataFrame([trial["strides"][method][0] for trial in trials])
    return {stroke: float(firsts[f"{stroke}_force_n"].astype(float).abs().mean()) for stroke in STROKES}


def _misfits_n(trial: Entry, configuration: Configuration, method: str) -> dict[str, float | None]:
    """Return the root mean square difference between the measured forces of one stride and the laws, by stroke."""
    profile, stride = profile_from_row(trial["course"]), trial["strides"][method][0]
    surface_m = stride["surface_m"] or 0.0
    laws = modelled_forces(profile, configuration.geometry, surface_m, drawn_coefficients(stride), method)
    rows = {name: profile.during(STROKES[name]) for name in ("insertion", "extraction")}
    upward = {name: misfit_n(profile.force_z_n[each], laws.force_z_n[each]) for name, each in rows.items()}
    return upward | {"stance": misfit_n(profile.force_x_n, laws.force_x_n)}


def _later_strokes(by_mud: Mapping[str, Sequence[Entry]], method: str) -> dict[str, list[float]]:
    """Compare each stride with the first one in the same hole: the mean ratio over the trials that have both."""
    trials = [trial["strides"][method] for trials in by_mud.values() for trial in trials]
    rows = [
        {"trial": trial, "number": number, "coefficient": name, "value": each["value"] if each["valid"] else nan}
        for trial, strides in enumerate(trials)
        for number, stride in enumerate(strides)
        for name, each in ((name, stride[name]) for name in COEFFICIENTS)
    ]
    if not rows:
        return {name: [] for name in COEFFICIENTS}
    values = DataFrame(rows).pivot(index=["trial", "coefficient"], columns="number", values="value")
    ratios = values.div(values[0], axis=0).drop(columns=[0]).groupby("coefficient").mean()
    return {name: ratios.loc[name].dropna().tolist() for name in COEFFICIENTS}
