"""What a person is shown of the single flipper's trials: sections with tables and pictures, and the screen's text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from experiments.flipper.measurement import AUTHORS_MUD, AUTHORS_N, Plan, muds_of, trials_of
from experiments.loadcell.comparison import OTHER_PLATE
from experiments.reports.coefficient_table import error_text_rows, mud_rows
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name
from experiments.reports.report_page import Figure, Section
from experiments.trials.estimation_methods import DEFAULT
from experiments.trials.mud_trials import left_out_texts
from experiments.trials.notebook import Entry
from firmware_host.configuration.configuration import Configuration

STROKES = tuple(AUTHORS_N)
TRUTHS = {
    "bed": "The load cell is a virtual one: it repeats each stroke with the flipper's own plate, to the same depth; "
    "insertion and extraction along the flipper's own arc, and without what the plate's face bears, which is no part "
    "of k_p and k_e. (A leaning plate pushed straight down would read 4 % more k_p at 3 cm and 31 % at 5 cm.)",
    "file": f"The load cell is that of the file given with --truth. {OTHER_PLATE}",
}
KNOWN_BIAS = (
    "k_e by the default method reads 1 to 5 % more than the load cell on a simulated fixed base without any "
    "disturbance, and -8 to +14 % under a simulated robot that walks, the more the softer the mud. On the fixed base "
    "about 1 % each is of the face's load, which is taken off as if its pressure grew from nothing at the surface; of "
    "the zero, for which the way down counts while the plate's lower corner is in the mud; and of the surface, found "
    "0.2 mm too deep. For the same surface k_p reads 0 to 4 % more at 3 to 5 cm. In real mud nobody has measured it."
)
WRONG_CONSTANTS = (
    "Each simulated motor's torque constant is another than the configuration has, by a draw of 3.2 %, as the paper's "
    "were. All that a joint tells is off by that in the same way: the second ± holds it, the first cannot show it."
)
UNCERTAINTIES = (
    "The first ± is one standard error by the scatter of the trials, the second what all of them have alike as far as "
    "the daemon doubts it: torque constants (3.2 %), the face's load, zero, surface. Two of both together hold what "
    "a load cell reads on the flipper's own way in 19 of 20 cases or more; to tell muds of one robot apart the first "
    "alone counts. A single trial has one ±, of everything. Repeatability is the standard deviation of the trials "
    "over their mean."
)
HEADING = (
    "Coefficients ± one standard error of the trials ± one of what all have alike; what each holds: see the report"
)
ERRORS = "Median error of single strides beside the load cell, in brackets the bias"
FORCES = "Largest forces, in brackets what the laws leave over"
MODELLED = (
    "B to E as in the paper's figure 4. Dashed: the forces by the fitted coefficients, where each is fitted. The "
    "default method's laws tell a joint's torque; it takes the place of the measured one, and goes with the other "
    "joint's measured torque through the map from torques to forces that the measured force went through. f_z is not "
    "drawn in stance, where two torques do not tell it from the sideways force."
)
MODELLED_PAPER = (
    "B to E as in the paper's figure 4. Dashed: the forces by the fitted coefficients and the paper's laws."
)


def sections_of(
    report: Mapping[str, Any], plan: Plan, entries: Mapping[str, Entry], configuration: Configuration
) -> list[Section]:
    method = report["settings"]["method"]
    firsts = {mud: trials[0] for mud in muds_of(plan, entries) if (trials := trials_of(mud, entries))}
    sections = [_coefficients(report, firsts, configuration)]
    if report["errors"]:
        sections.append(_errors(report))
    sections.append(_forces(report))
    sections.append(_strides(firsts, configuration, method))
    remarks = [f"{mud_text(mud.mud)}: {remark}" for mud in report["muds"] for remark in mud.remarks]
    return sections + remarked([*remarks, *left_out_texts(report.get("left_out", {}))])


def remarked(remarks: Sequence[str]) -> list[Section]:
    """One of sentences, where there are any."""
    reported = "\n\n".join(f"{remark.rstrip('.')}." for remark in remarks)
    return [Section("What was remarked", reported)] * bool(remarks)


def _coefficients(report: Mapping[str, Any], firsts: Mapping[str, Entry], configuration: Configuration) -> Section:
    from experiments.flipper.plots import plot_coefficients  # matplotlib takes its time

    caption = (
        "Figure 5 of the paper. A to C: force of one trial a mud. D to F: coefficients, mean and standard deviation "
        "over the trials, which are the grey dashes."
    )
    if any(mud.truth for mud in report["muds"]):
        caption += " G to I: beside a load cell's, with two standard errors; on the grey line both are equal."
    draw = partial(plot_coefficients, report["muds"], firsts, configuration.geometry)
    figure = Figure("figure5", caption, draw)
    return Section("Coefficients of the muds", _reported(report), rows=mud_rows(report["muds"]), figures=[figure])


def _reported(report: Mapping[str, Any]) -> str:
    falls = {name: fell for name, fell in report["falls_with_water"].items() if fell is not None}
    paragraphs = [report["missing_truth"]] if report["missing_truth"] else []
    if falls:
        fell = ", ".join(f"{name} {'yes' if fell else 'no'}" for name, fell in falls.items())
        paragraphs.append(f"Does a coefficient fall with water from mud to mud, as in the paper? {fell}.")
    later = {name: fractions for name, fractions in report["later_strokes"].items() if fractions}
    for name, fractions in later.items():
        strokes = ", ".join(f"{100.0 * fraction:.0f} %" for fraction in fractions)
        paragraphs.append(f"{name} of later strides in the same hole, of the first one's: {strokes}.")
    return "\n\n".join([*paragraphs, UNCERTAINTIES, *uncertainties(report["settings"])])


def uncertainties(settings: Mapping[str, Any]) -> list[str]:
    """What is wrong with the figures beyond their scatter, to be read beside them."""
    known = [KNOWN_BIAS] * (settings["method"] == DEFAULT)
    return known + [WRONG_CONSTANTS] * settings["simulated"]


def _errors(report: Mapping[str, Any]) -> Section:
    text = f"{ERRORS}. {TRUTHS[report['settings']['truth']]}"
    return Section("Beside the load cell", text, rows=error_text_rows(report["errors"]))


def _forces(report: Mapping[str, Any]) -> Section:
    text = (
        "Largest forces of first strides, mean over the trials, and in brackets what the laws leave over of the forces "
        f"of one trial (root mean square). The authors' are those of their raw logs in the mud that they call "
        f"{AUTHORS_MUD}, whose water they do not say."
    )
    return Section("Forces", text, rows=force_rows(report))


def force_rows(report: Mapping[str, Any]) -> list[list[str]]:
    rows = [["mud", *(f"{stroke} (N)" for stroke in STROKES)]]
    for mud, forces in report["largest_forces_n"].items():
        misfits = report["misfit_n"][mud]
        rows.append([mud_text(mud), *(_force_text(forces[stroke], misfits[stroke]) for stroke in STROKES)])
    rows.append(["authors' logs", *(f"{low:g} to {high:g}" for low, high in AUTHORS_N.values())])
    return rows


def _force_text(force_n: float | None, misfit_n: float | None) -> str:
    text = "-" if force_n is None else f"{force_n:.2f}"
    return text if misfit_n is None else f"{text} ({misfit_n:.2f})"


def _strides(firsts: Mapping[str, Entry], configuration: Configuration, method: str) -> Section:
    from experiments.flipper.plots import plot_stride

    law = MODELLED_PAPER if method == "paper" else MODELLED
    figures = [
        Figure(
            f"figure4_{file_name(mud)}",
            f"Figure 4 of the paper, mud {mud_text(mud)}.",
            partial(plot_stride, trial, configuration.geometry, method),
        )
        for mud, trial in firsts.items()
    ]
    return Section("Strides", law, figures=figures)


def text_of(report: Mapping[str, Any]) -> list[tuple[str, Sequence[Sequence[str]]]]:
    """Titles and tables for the screen."""
    tables: list[tuple[str, Sequence[Sequence[str]]]] = [(HEADING, mud_rows(report["muds"]))]
    if report["errors"]:
        tables.append((ERRORS, error_text_rows(report["errors"])))
    return [*tables, (FORCES, force_rows(report))]
