"""The single flipper's finding: sections with tables and pictures for the page, and tables for the screen.

The walking robot's page uses the same explanations of errors (experiments/walk/text.py).
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from experiments.flipper.measurement import Plan, run
from experiments.flipper.report import STROKES, FlipperReport, muds_of, report_of, trials_of
from experiments.flipper.simulation import flipper_bench
from experiments.loadcell.comparison import OTHER_PLATE
from experiments.reports.coefficient_table import MudSummary, error_text_rows, mud_rows
from experiments.reports.error_table import Row
from experiments.reports.mud_names import mud_text
from experiments.reports.mud_styles import file_name
from experiments.reports.report_page import Figure, Section
from experiments.reports.text_tables import TitledRows, text_of_tables
from experiments.study.notebook import Entry
from experiments.trials.estimation_methods import DEFAULT
from experiments.trials.mud_trials import SEED, left_out_texts, open_bench, run_trials
from experiments.trials.session import Finding, Session
from experiments.trials.truth_file import load_truth
from firmware_host.configuration.configuration import Configuration

# Least and largest force of first strokes in N, from the authors' raw logs in the mud that they call 12.5N.
AUTHORS_MUD, AUTHORS_N = "12.5N", {"insertion": (2.5, 2.8), "stance": (7.4, 8.3), "extraction": (1.9, 2.3)}
INSTRUCTIONS = (
    "Torque is off and the flippers are down. Level the mud to its nominal height and put the flipper over a fresh "
    "spot, or re-mix the mud: the same hole loses 15 to 20 % with each stroke. Take your hands away: the flipper moves "
    "next"
)
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
FORCES = "Largest forces, in brackets the misfit of the laws"
MODELLED = (
    "B to E as in the paper's figure 4. Dashed: the forces by the fitted coefficients, where each is fitted. The "
    "default method's laws give the torque of one joint; it replaces the measured torque, and with the other joint's "
    "measured torque goes through the same map from torques to forces as the measurement. f_z is not drawn in stance, "
    "where two torques cannot separate it from the sideways force."
)
MODELLED_PAPER = (
    "B to E as in the paper's figure 4. Dashed: the forces by the fitted coefficients and the paper's laws."
)


def run_flipper(plan: Plan, session: Session, truth_path: Path | None) -> Finding:
    """Make the trials and report them. Raises BenchError."""
    truth = load_truth(truth_path) if truth_path else None
    simulated = partial(flipper_bench, session.folder, plan.muds, SEED, plan.simulated_rig)
    bench = open_bench(session, plan.identity, lambda trial: INSTRUCTIONS, simulated)
    configuration, entries, logs = run_trials(bench, session, lambda: run(bench, plan, session.show))
    report = report_of(plan, entries, configuration, truth, bench.notebook.left_out)
    sections = sections_of(report, plan, entries, configuration)
    return Finding(report, "A single flipper through muds", sections, text_of_tables(tables_of(report)), logs)


def sections_of(
    report: FlipperReport, plan: Plan, entries: Mapping[str, Entry], configuration: Configuration
) -> list[Section]:
    firsts = {mud: trials[0] for mud in muds_of(plan, entries) if (trials := trials_of(mud, entries))}
    sections = [_coefficients(report, firsts, configuration)]
    if report.errors:
        text = f"{ERRORS}. {TRUTHS[report.settings['truth']]}"
        sections.append(Section("Comparison with the load cell", text, rows=error_text_rows(report.errors)))
    sections += [_forces(report), _strides(firsts, configuration, report.settings["method"])]
    remarks = [f"{mud_text(mud.mud)}: {remark}" for mud in report.muds for remark in mud.remarks]
    return sections + remarks_sections(remarks, report.left_out)


def remarks_sections(remarks: Sequence[str], left_out: Mapping[str, Entry]) -> list[Section]:
    """Return a section with the remarks of all trials; nothing where there are none."""
    text = "\n\n".join(f"{remark.rstrip('.')}." for remark in [*remarks, *left_out_texts(left_out)])
    return [Section("Remarks", text)] * bool(text)


def coefficient_tables(muds: Sequence[MudSummary], errors: Sequence[Row]) -> list[TitledRows]:
    """Return the tables that every report of coefficients has on the screen."""
    tables: list[TitledRows] = [(HEADING, mud_rows(muds))]
    return tables + [(ERRORS, error_text_rows(errors))] * bool(errors)


def error_paragraphs(settings: Mapping[str, Any]) -> list[str]:
    """Explain the errors that the scatter of the trials does not show."""
    known = [KNOWN_BIAS] * (settings["method"] == DEFAULT)
    return known + [WRONG_CONSTANTS] * settings["simulated"]


def _coefficients(report: FlipperReport, firsts: Mapping[str, Entry], configuration: Configuration) -> Section:
    from experiments.flipper.plots import plot_coefficients  # matplotlib takes its time

    caption = (
        "Figure 5 of the paper. A to C: force of one trial in each mud. D to F: coefficients, mean and standard "
        "deviation over the trials; each grey dash is a trial."
    )
    if any(mud.truth for mud in report.muds):
        caption += " G to I: against the load cell, with two standard errors; on the grey line both are equal."
    draw = partial(plot_coefficients, report.muds, firsts, configuration.geometry)
    figure = Figure("figure5", caption, draw)
    return Section("Coefficients of the muds", _explanation(report), rows=mud_rows(report.muds), figures=[figure])


def _explanation(report: FlipperReport) -> str:
    paragraphs = [report.missing_truth] if report.missing_truth else []
    falls = {name: falls for name, falls in report.falls_with_water.items() if falls is not None}
    if falls:
        answers = ", ".join(f"{name} {'yes' if each else 'no'}" for name, each in falls.items())
        paragraphs.append(f"Does a coefficient fall with water from mud to mud, as in the paper? {answers}.")
    for name, fractions in report.later_strokes.items():
        if fractions:
            percent = ", ".join(f"{100.0 * fraction:.0f} %" for fraction in fractions)
            paragraphs.append(f"{name} of later strides in the same hole, relative to the first: {percent}.")
    return "\n\n".join([*paragraphs, UNCERTAINTIES, *error_paragraphs(report.settings)])


def _forces(report: FlipperReport) -> Section:
    text = (
        "Largest forces of first strides, mean over the trials, and in brackets the misfit of the laws in one trial "
        f"(root mean square). The authors' forces are from their raw logs in the mud that they call {AUTHORS_MUD}, "
        "whose water content they do not report."
    )
    return Section("Forces", text, rows=force_rows(report))


def force_rows(report: FlipperReport) -> list[list[str]]:
    rows = [["mud", *(f"{stroke} (N)" for stroke in STROKES)]]
    for mud, forces in report.largest_forces_n.items():
        misfits = report.misfit_n[mud]
        rows.append([mud_text(mud), *(_force_text(forces[stroke], misfits[stroke]) for stroke in STROKES)])
    rows.append(["authors' logs", *(f"{low:g} to {high:g}" for low, high in AUTHORS_N.values())])
    return rows


def _force_text(force_n: float | None, misfit_n: float | None) -> str:
    text = "-" if force_n is None else f"{force_n:.2f}"
    return text if misfit_n is None else f"{text} ({misfit_n:.2f})"


def _strides(firsts: Mapping[str, Entry], configuration: Configuration, method: str) -> Section:
    from experiments.flipper.plots import plot_stride

    figures = [
        Figure(
            f"figure4_{file_name(mud)}",
            f"Figure 4 of the paper, mud {mud_text(mud)}.",
            partial(plot_stride, trial, configuration.geometry, method),
        )
        for mud, trial in firsts.items()
    ]
    return Section("Strides", MODELLED_PAPER if method == "paper" else MODELLED, figures=figures)


def tables_of(report: FlipperReport) -> list[TitledRows]:
    return [*coefficient_tables(report.muds, report.errors), (FORCES, force_rows(report))]
