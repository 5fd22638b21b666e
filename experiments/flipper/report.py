"""The report of the single flipper's trials: coefficients by mud, their errors, the largest forces, and the misfit."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import nan
from statistics import fmean
from typing import Any

from pandas import DataFrame

from control.records import COEFFICIENTS, Phase
from experiments.flipper.modelled_force import misfit_n, modelled_stride
from experiments.flipper.plots import draw_coefficients, draw_stride
from experiments.reports.coefficient_table import compared_frame, compared_rows, error_table, mud_summaries
from experiments.reports.error_table import Row
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name, waters_of
from experiments.reports.text_tables import number
from experiments.study.notebook import Entry
from experiments.study.result import Figure, Result, Table
from experiments.trials.coefficient_page import (
    COMPARISON,
    TRUTHS,
    coefficient_tables,
    error_paragraphs,
    remark_texts,
    truth_settings,
)
from experiments.trials.estimation_methods import configured_method
from experiments.trials.mud_trials import MeasuredTrials
from experiments.trials.stride_profile import stroke_of
from experiments.trials.truth_file import TruthOfMud, truth_in
from firmware_host.configuration.configuration import Configuration

STROKES = {"insertion": Phase.INSERTION, "stance": Phase.STANCE, "extraction": Phase.EXTRACTION}
# Least and largest force of first strokes in N, from the authors' raw logs in the mud that they call 12.5N.
AUTHORS_MUD, AUTHORS_N = "12.5N", {"insertion": (2.5, 2.8), "stance": (7.4, 8.3), "extraction": (1.9, 2.3)}
MUDS, FORCES, STRIDES = "Coefficients of the muds", "Forces", "Strides"  # the parts of the page
FORCES_TEXT = (
    "Largest forces of first strides, mean over the trials, and in brackets the misfit of the laws in one trial (root "
    f"mean square). The authors' forces are from their raw logs in the mud that they call {AUTHORS_MUD}, whose water "
    "content they do not report."
)
MODELLED = (
    "B to E as in the paper's figure 4. Dashed: the forces by the fitted coefficients, where each is fitted. The "
    "default method's laws give the torque of one joint; it replaces the measured torque, and with the other joint's "
    "measured torque goes through the same map from torques to forces as the measurement. f_z is not drawn in stance, "
    "where two torques cannot separate it from the sideways force."
)
MODELLED_PAPER = (
    "B to E as in the paper's figure 4. Dashed: the forces by the fitted coefficients and the paper's laws."
)
CAPTION = (
    "Figure 5 of the paper. A to C: force of one trial in each mud. D to F: coefficients, mean with two standard "
    "errors; each grey dash is a trial, an arrow a lower bound."
)
COMPARED = " G to I: against the load cell; on the grey line both are equal."
Report = dict[str, Any]  # the summary, as it is in JSON
Trials = dict[str, list[Entry]]  # by mud


def result_of(
    settings: Mapping[str, Any], muds: Sequence[str], measured: MeasuredTrials, truth: TruthOfMud | None
) -> Result:
    """Report the trials that count. `truth` is another experiment's; without it the bed's own load cell is used."""
    by_mud, configuration = trials_by_mud(muds, measured.entries), measured.configuration
    report = _report_of(by_mud, configuration, truth) | {"left_out": measured.left_out}
    report |= truth_settings(settings, configuration, truth, by_mud)
    method, firsts = report["settings"]["method"], {mud: trials[0] for mud, trials in by_mud.items()}
    compared = any(mud["truth"] for mud in report["muds"])
    coefficients = partial(draw_coefficients, report["muds"], firsts)
    figures = [Figure("figure5", CAPTION + COMPARED * compared, coefficients, MUDS)]
    for mud, trial in firsts.items():
        draw = partial(draw_stride, trial, configuration.geometry, method)
        caption = f"Figure 4 of the paper, mud {mud_text(mud)}."
        figures.append(Figure(f"figure4_{file_name(mud)}", caption, draw, STRIDES))
    texts = {
        MUDS: _explanation(report),
        COMPARISON: TRUTHS[report["settings"]["truth"]] if report["errors"] else "",
        FORCES: FORCES_TEXT,
        STRIDES: MODELLED_PAPER if method == "paper" else MODELLED,
    }
    remarks = [f"{mud_text(mud['mud'])}: {remark}" for mud in report["muds"] for remark in mud["remarks"]]
    return Result(
        tables=[*coefficient_tables(report, MUDS), _force_table(report)],
        figures=figures,
        summary=report,
        title="A single flipper through muds",
        texts=texts | remark_texts(remarks, measured.left_out),
        logs=measured.logs,
    )


def trials_by_mud(muds: Sequence[str], entries: Mapping[str, Entry]) -> Trials:
    """Return the trials in their order; other muds that were measured before follow those of this command."""
    trials = sorted(entries.values(), key=lambda entry: int(entry["trial"]))
    by_mud: Trials = {mud: [] for mud in [*muds, *(entry["mud"] for entry in entries.values())]}
    for trial in trials:
        by_mud[trial["mud"]].append(trial)
    return {mud: own for mud, own in by_mud.items() if own}


def _report_of(by_mud: Trials, configuration: Configuration, truth: TruthOfMud | None) -> Report:
    method, geometry = configured_method(configuration.estimation), configuration.geometry
    rows: list[Row] = []  # the first stride of each trial
    for mud, trial in ((mud, trial) for mud, trials in by_mud.items() for trial in trials):
        known = truth_in(truth, mud) if truth else trial["truths"].get("0", {})
        for name, strides in trial["strides"].items():
            rows += compared_rows(strides[0], known, mud=mud, method=name, trial=trial["trial"]) if strides else []
    compared = compared_frame(rows)
    muds = mud_summaries(compared, by_mud, method, fmean)
    for summary in muds:
        summary["remarks"] = [remark for trial in by_mud[summary["mud"]] for remark in trial["remarks"]]
    plate = geometry.plate
    return {
        "experiment": "flipper",
        "muds": muds,
        "errors": error_table(compared, "single flipper"),
        "falls_with_water": {name: _falls_with_water(muds, name) for name in COEFFICIENTS},
        "largest_forces_n": {mud: _largest_forces_n(trials, method) for mud, trials in by_mud.items()},
        "misfit_n": {mud: _misfits_n(trials[0], configuration, method) for mud, trials in by_mud.items()},
        "later_strokes": _later_strokes([each["strides"][method] for trials in by_mud.values() for each in trials]),
        "plate_m": {"width": plate.width_m, "height": plate.height_m, "thickness": geometry.plate_thickness_m},
    }


def _falls_with_water(muds: Sequence[Mapping[str, Any]], name: str) -> bool | None:
    """Return whether the coefficient falls with water, as in the paper; None without two values in known waters."""
    waters = waters_of([mud["mud"] for mud in muds]) or ()
    found = [(water, mud[name]) for water, mud in zip(waters, muds, strict=False)]
    known = sorted((water, each.value) for water, each in found if each.trials and not each.at_least)
    return all(drier > wetter for (_, drier), (_, wetter) in pairwise(known)) if len(known) > 1 else None


def _largest_forces_n(trials: Sequence[Entry], method: str) -> dict[str, float]:
    """Average the largest forces of the first strides by stroke; NaN where there are none."""
    firsts = DataFrame([trial["strides"][method][0] for trial in trials])
    return {stroke: float(firsts[f"{stroke}_force_n"].astype(float).abs().mean()) for stroke in STROKES}


def _misfits_n(trial: Entry, configuration: Configuration, method: str) -> dict[str, float | None]:
    """Return the root mean square difference between the measured forces of one stride and the laws, by stroke."""
    stride = modelled_stride(trial, configuration.geometry, method)
    strokes = {name: stroke_of(stride, STROKES[name]) for name in ("insertion", "extraction")}
    upward = {name: misfit_n(rows["force_z_n"], rows["law_z_n"]) for name, rows in strokes.items()}
    return upward | {"stance": misfit_n(stride["force_x_n"], stride["law_x_n"])}


def _later_strokes(trials: Sequence[Sequence[Mapping[str, Any]]]) -> dict[str, list[float]]:
    """Compare each stride with the first one in the same hole: the mean ratio over the trials with a value of both."""
    rows = [
        {"trial": trial, "number": number}
        | {
            name: own["value"] if (own := stride[name])["valid"] and not own["at_least"] else nan
            for name in COEFFICIENTS
        }
        for trial, strides in enumerate(trials)
        for number, stride in enumerate(strides)
    ]
    values = DataFrame(rows).set_index(["trial", "number"])
    ratios = values.div(values.xs(0, level="number"), level="trial").groupby("number").mean().drop(index=0)
    return {name: ratios[name].dropna().tolist() for name in COEFFICIENTS}


# the page


def _explanation(report: Report) -> str:
    paragraphs = [report["missing_truth"]] if report["missing_truth"] else []
    falls = {name: falls for name, falls in report["falls_with_water"].items() if falls is not None}
    if falls:
        answers = ", ".join(f"{name} {'yes' if each else 'no'}" for name, each in falls.items())
        paragraphs.append(f"Does a coefficient fall with water from mud to mud, as in the paper? {answers}.")
    for name, fractions in report["later_strokes"].items():
        if fractions:
            percent = ", ".join(f"{100.0 * fraction:.0f} %" for fraction in fractions)
            paragraphs.append(f"{name} of later strides in the same hole, relative to the first: {percent}.")
    return "\n\n".join([*paragraphs, *error_paragraphs(report["settings"])])


def _force_table(report: Report) -> Table:
    rows = [
        {"mud": mud_text(mud)}
        | {
            stroke: number(forces_n[stroke], 2) + (f" ({misfit:.2f})" if misfit is not None else "")
            for stroke, misfit in report["misfit_n"][mud].items()
        }
        for mud, forces_n in report["largest_forces_n"].items()
    ]
    authors = {stroke: f"{low:g} to {high:g}" for stroke, (low, high) in AUTHORS_N.items()}
    frame = DataFrame([*rows, {"mud": "authors' logs"} | authors], columns=["mud", *STROKES])
    title = "Largest forces, in brackets the misfit of the laws"
    return Table("forces", title, dict.fromkeys(STROKES, "N"), frame, FORCES)
