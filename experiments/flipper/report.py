"""The report of the single flipper's trials: coefficients by mud, their errors, the largest forces, and the misfit.

The fields of these records are the keys of the summary in JSON.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import Any

from control.records import Phase
from experiments.flipper.measurement import FlipperTrials
from experiments.flipper.modelled_force import drawn_coefficients, misfit_n, modelled_forces
from experiments.reports.coefficient_table import ComparedStride, MudSummary, error_table, gather_coefficients
from experiments.reports.error_table import COEFFICIENTS, Row
from experiments.study.notebook import Entry
from experiments.trials.estimation_methods import configured_method
from experiments.trials.stride_profile import profile_from_row
from experiments.trials.truth_file import TruthOfMud, missing_text, truth_in
from firmware_host.configuration.configuration import Configuration

STROKES = {"insertion": Phase.INSERTION, "stance": Phase.STANCE, "extraction": Phase.EXTRACTION}
ForceByStroke = Mapping[str, float | None]  # N


@dataclass(frozen=True)
class FlipperMud(MudSummary):
    remarks: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class FlipperReport:
    experiment: str = "flipper"
    muds: Sequence[FlipperMud]
    errors: Sequence[Row]
    falls_with_water: Mapping[str, bool | None]  # by coefficient
    largest_forces_n: Mapping[str, ForceByStroke]  # by mud
    misfit_n: Mapping[str, ForceByStroke]  # by mud
    later_strokes: Mapping[str, Sequence[float]]  # by coefficient, as a fraction of the first stroke's
    missing_truth: str
    settings: Mapping[str, Any]
    plate_m: Mapping[str, float]
    left_out: Mapping[str, Entry]


def report_of(
    plan: FlipperTrials,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    truth: TruthOfMud | None,
    left_out: Mapping[str, Entry] | None = None,
) -> FlipperReport:
    """Report the trials that count. `truth` is another experiment's; without it the bed's own load cell is used."""
    method, geometry = configured_method(configuration.estimation), configuration.geometry
    by_mud = {mud: trials for mud in muds_of(plan, entries) if (trials := trials_of(mud, entries))}
    rows = _compared_strides(by_mud, truth)
    muds = [_mud_report(mud, trials, method, rows) for mud, trials in by_mud.items()]
    return FlipperReport(
        muds=muds,
        errors=error_table(rows, "single flipper"),
        falls_with_water={name: _falls_with_water(muds, name) for name in COEFFICIENTS},
        largest_forces_n={mud: _largest_forces_n(trials, method) for mud, trials in by_mud.items()},
        misfit_n={mud: _misfits_n(trials[0], configuration, method) for mud, trials in by_mud.items()},
        later_strokes=_later_strokes(by_mud, method),
        missing_truth=missing_text(truth, by_mud),
        settings=plan.identity | {"method": method, "truth": "file" if truth else "bed"},
        plate_m={
            "width": geometry.plate.width_m,
            "height": geometry.plate.height_m,
            "thickness": geometry.plate_thickness_m,
        },
        left_out=left_out or {},
    )


def muds_of(plan: FlipperTrials, entries: Mapping[str, Entry]) -> list[str]:
    return list(dict.fromkeys([*plan.muds, *(entry["mud"] for entry in entries.values())]))


def trials_of(mud: str, entries: Mapping[str, Entry]) -> list[Entry]:
    return sorted((entry for entry in entries.values() if entry["mud"] == mud), key=lambda entry: int(entry["trial"]))


def _compared_strides(by_mud: Mapping[str, Sequence[Entry]], truth: TruthOfMud | None) -> list[ComparedStride]:
    """Pair the first stride of each trial with the load cell's readings."""
    return [
        ComparedStride(mud, method, strides[0], truth_in(truth, mud) if truth else trial["truths"].get("0", {}))
        for mud, trials in by_mud.items()
        for trial in trials
        for method, strides in trial["strides"].items()
        if strides
    ]


def _mud_report(mud: str, trials: Sequence[Entry], method: str, rows: Sequence[ComparedStride]) -> FlipperMud:
    own = [row for row in rows if row.mud == mud and row.method == method]
    truths = {name: [value for row in own if (value := row.truth.get(name)) is not None] for name in COEFFICIENTS}
    return FlipperMud(
        mud=mud,
        **gather_coefficients([row.stride for row in own]),
        truth={name: fmean(values) for name, values in truths.items() if values} or None,
        remarks=[remark for trial in trials for remark in trial["remarks"]],
    )


def _falls_with_water(muds: Sequence[MudSummary], name: str) -> bool | None:
    """Return whether the coefficient falls with water, as in the paper; None where the names are no water contents."""
    try:
        known = sorted((float(mud.mud), value) for mud in muds if (value := mud.coefficient(name).value) is not None)
    except ValueError:
        return None
    return all(drier > wetter for (_, drier), (_, wetter) in pairwise(known)) if len(known) > 1 else None


def _largest_forces_n(trials: Sequence[Entry], method: str) -> ForceByStroke:
    """Average the largest forces of the first strides."""
    first = [trial["strides"][method][0] for trial in trials]
    forces_n = {
        stroke: [abs(force_n) for stride in first if (force_n := stride[f"{stroke}_force_n"]) is not None]
        for stroke in STROKES
    }
    return {stroke: fmean(values) if values else None for stroke, values in forces_n.items()}


def _misfits_n(trial: Entry, configuration: Configuration, method: str) -> ForceByStroke:
    """Return the root mean square difference between the measured forces of one stride and the laws."""
    profile, stride = profile_from_row(trial["course"]), trial["strides"][method][0]
    surface_m = stride["surface_m"] or 0.0
    laws = modelled_forces(profile, configuration.geometry, surface_m, drawn_coefficients(stride), method)
    rows = {name: profile.during(STROKES[name]) for name in ("insertion", "extraction")}
    upward = {name: misfit_n(profile.force_z_n[each], laws.force_z_n[each]) for name, each in rows.items()}
    return upward | {"stance": misfit_n(profile.force_x_n, laws.force_x_n)}


def _later_strokes(by_mud: Mapping[str, Sequence[Entry]], method: str) -> dict[str, list[float]]:
    """Compare each stride with the first one in the same hole: the mean ratio over the trials that have both."""
    trials = [trial["strides"][method] for by_trial in by_mud.values() for trial in by_trial]
    longest = max((len(strides) for strides in trials), default=0)
    ratios = {name: [_ratios(trials, name, number) for number in range(1, longest)] for name in COEFFICIENTS}
    return {name: [fmean(each) for each in by_number if each] for name, by_number in ratios.items()}


def _ratios(trials: Sequence[Sequence[Mapping[str, Any]]], name: str, number: int) -> list[float]:
    pairs = [(strides[0][name], strides[number][name]) for strides in trials if len(strides) > number]
    return [later["value"] / first["value"] for first, later in pairs if first["valid"] and later["valid"]]
