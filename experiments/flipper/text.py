"""The single flipper's tables, figures and explanations.

The walking robot's page uses the same explanations of errors (experiments/walk/text.py).
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pandas import DataFrame

from experiments.flipper.measurement import FlipperTrials
from experiments.flipper.plots import draw_coefficients, draw_stride
from experiments.flipper.report import STROKES, Report, muds_of, trials_of
from experiments.loadcell.comparison import OTHER_PLATE
from experiments.reports.coefficient_table import error_text_table, mud_table
from experiments.reports.error_table import Row
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name
from experiments.reports.text_tables import number
from experiments.study.notebook import Entry
from experiments.study.result import Figure, Result, Table
from experiments.trials.estimation_methods import DEFAULT
from experiments.trials.mud_trials import left_out_texts
from firmware_host.configuration.configuration import Configuration

# Least and largest force of first strokes in N, from the authors' raw logs in the mud that they call 12.5N.
AUTHORS_MUD, AUTHORS_N = "12.5N", {"insertion": (2.5, 2.8), "stance": (7.4, 8.3), "extraction": (1.9, 2.3)}
TRUTHS = {
    "bed": "The load cell is a virtual one: it repeats each stroke with the flipper's own plate, to the same depth. "
    "Insertion and extraction follow the flipper's own arc, without the load on the plate's face, which is no part of "
    "k_p and k_e. (A leaning plate pushed straight down would read 4 % more k_p at 3 cm and 31 % at 5 cm.)",
    "file": f"The load cell is that of the file given with --truth. {OTHER_PLATE}",
}
KNOWN_BIAS = (
    "On a simulated fixed base without disturbances, k_e by the default method is 1 to 5 % above the load cell; for a "
    "simulated robot that walks it is off by -8 to +14 %, more in softer mud. On the fixed base about 1 % each comes "
    "from the load on the face, whose pressure is assumed to grow from zero at the surface; from the tare, which "
    "counts the insertion while the plate's lower corner is in the mud; and from the surface, found 0.2 mm too deep. "
    "k_p is 0 to 4 % too high at 3 to 5 cm, because of the same surface. The bias in real mud is not known."
)
WRONG_CONSTANTS = (
    "The torque constant of each simulated motor differs from the configured one by a random 3.2 % (one standard "
    "deviation), like the paper's motors. It shifts every measurement of a joint alike: the second ± includes it, the "
    "first one cannot show it."
)
UNCERTAINTIES = (
    "The first ± is one standard error from the scatter of the trials. The second ± is what all trials have in common, "
    "as the daemon estimates it: torque constants (3.2 %), load on the face, tare, surface. Twice the sum of both "
    "contains the reading of a load cell on the flipper's own path in 19 of 20 cases or more. To compare muds of one "
    "robot, use the first alone. A single trial has one ± for everything. Repeatability is the standard deviation of "
    "the trials over their mean."
)
HEADING = "Coefficients ± one standard error of the trials ± one that all trials share; explained in the report"
ERRORS = "Median error of single strides against the load cell, in brackets the bias"
COEFFICIENTS, COMPARISON, FORCES, STRIDES = (  # the parts of the page
    "Coefficients of the muds", "Comparison with the load cell", "Forces", "Strides"
)  # fmt: skip
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


def result_of(
    report: Report,
    plan: FlipperTrials,
    entries: Mapping[str, Entry],
    configuration: Configuration,
    logs: Sequence[Path],
) -> Result:
    """Return the tables, figures and explanations of all trials."""
    firsts = {mud: trials[0] for mud in muds_of(plan, entries) if (trials := trials_of(mud, entries))}
    method = report["settings"]["method"]
    remarks = [f"{mud_text(mud['mud'])}: {remark}" for mud in report["muds"] for remark in mud["remarks"]]
    return Result(
        tables=[*coefficient_tables(report["muds"], report["errors"], COEFFICIENTS), _force_table(report)],
        figures=[_coefficient_figure(report, firsts, configuration), *_stride_figures(firsts, configuration, method)],
        summary=report,
        title="A single flipper through muds",
        texts={
            COEFFICIENTS: _explanation(report),
            COMPARISON: TRUTHS[report["settings"]["truth"]] if report["errors"] else "",
            FORCES: FORCES_TEXT,
            STRIDES: MODELLED_PAPER if method == "paper" else MODELLED,
        }
        | remark_texts(remarks, report["left_out"]),
        logs=logs,
    )


def remark_texts(remarks: Sequence[str], left_out: Mapping[str, Entry]) -> dict[str, str]:
    """Return the section with the remarks of all trials; nothing where there are none."""
    sentences = [f"{remark.rstrip('.')}." for remark in [*remarks, *left_out_texts(left_out)]]
    return {"Remarks": "\n\n".join(sentences)} if sentences else {}


def coefficient_tables(muds: Sequence[Mapping[str, Any]], errors: Sequence[Row], section: str) -> list[Table]:
    """Return the tables of every report of coefficients; `section` is the part of the page with the muds."""
    tables = [Table("muds", HEADING, {}, mud_table(muds), section)]
    return [*tables, Table("errors", ERRORS, {}, error_text_table(errors), COMPARISON)] if errors else tables


def error_paragraphs(settings: Mapping[str, Any]) -> list[str]:
    """Explain the errors that the scatter of the trials does not show."""
    known = [KNOWN_BIAS] * (settings["method"] == DEFAULT)
    return known + [WRONG_CONSTANTS] * settings["simulated"]


def _coefficient_figure(report: Report, firsts: Mapping[str, Entry], configuration: Configuration) -> Figure:
    caption = (
        "Figure 5 of the paper. A to C: force of one trial in each mud. D to F: coefficients, mean and standard "
        "deviation over the trials; each grey dash is a trial."
    )
    if any(mud["truth"] for mud in report["muds"]):
        caption += " G to I: against the load cell, with two standard errors; on the grey line both are equal."
    draw = partial(draw_coefficients, report["muds"], firsts, configuration.geometry)
    return Figure("figure5", caption, draw, COEFFICIENTS)


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
    return "\n\n".join([*paragraphs, UNCERTAINTIES, *error_paragraphs(report["settings"])])


def _force_table(report: Report) -> Table:
    rows = [
        {"mud": mud_text(mud)} | {stroke: _force_text(forces_n[stroke], misfits_n[stroke]) for stroke in STROKES}
        for mud, forces_n in report["largest_forces_n"].items()
        for misfits_n in (report["misfit_n"][mud],)
    ]
    authors = {stroke: f"{low:g} to {high:g}" for stroke, (low, high) in AUTHORS_N.items()}
    frame = DataFrame([*rows, {"mud": "authors' logs"} | authors])
    return Table(
        "forces", "Largest forces, in brackets the misfit of the laws", dict.fromkeys(STROKES, "N"), frame, FORCES
    )


def _force_text(force_n: float, misfit_n: float | None) -> str:
    return number(force_n, 2) + (f" ({misfit_n:.2f})" if misfit_n is not None else "")


def _stride_figures(firsts: Mapping[str, Entry], configuration: Configuration, method: str) -> list[Figure]:
    return [
        Figure(
            f"figure4_{file_name(mud)}",
            f"Figure 4 of the paper, mud {mud_text(mud)}.",
            partial(draw_stride, trial, configuration.geometry, method),
            STRIDES,
        )
        for mud, trial in firsts.items()
    ]
