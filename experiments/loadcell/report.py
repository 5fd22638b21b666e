"""The load cell's results as sections of a page, and as tables for the screen."""

import re
from collections.abc import Mapping, Sequence
from functools import partial
from math import isfinite
from typing import Any

import numpy as np

from experiments.loadcell.analysis import CALLIPERS_M, COEFFICIENTS, MudCoefficient
from experiments.loadcell.comparison import OTHER_PLATE, Compared
from experiments.loadcell.evaluation import Results
from experiments.loadcell.plots import plot_coefficients, plot_mud
from experiments.loadcell.stage_track import common_alignment
from experiments.loadcell.strokes import RATE_EXPONENT, AnalysedTrial, Insertion, StageSettings
from experiments.loadcell.trials import TrialPlan
from experiments.reports.mud_names import mud_text
from experiments.reports.report_page import Figure, Section
from experiments.reports.text_tables import TitledRows
from experiments.reports.value_text import N_CM3, repeatability_text, value_text

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
HEADING = "Coefficients ± one standard error of the trials ± one of the bench; see the report for their parts"
COMPARED = "Flipper and load cell; see the report for the effects of plate and path alone"


def errors_text(muds: Mapping[str, Mapping[str, MudCoefficient]], plan: TrialPlan) -> str:
    """Explain the two errors of each value."""
    known = [(name, mud[name]) for mud in muds.values() for name in COEFFICIENTS if isfinite(mud[name].value)]
    largest = dict.fromkeys(COEFFICIENTS, 0.0)
    for name, each in known:
        largest[name] = max(largest[name], each.shared_error / each.value)
    fractions = ", ".join(f"{100.0 * fraction:.1f} % of {name}" for name, fraction in largest.items())
    return (
        "The first ± is one standard error of the trials. The second ± is alike in all trials: depth "
        f"± {1000.0 * plan.depth_error_m:g} mm (--depth-error), callipers ± {1000.0 * CALLIPERS_M:g} mm on width and "
        f"thickness, and the reading of the calibration, together at most {fractions}. k is the least-squares fit to "
        f"the mud's own curve and belongs to its depth; {ACCURACY} explains both errors."
    )


def comparison_text(flipper: Mapping[str, Any], settings: StageSettings) -> str:
    text = OTHER_PLATE
    depth_m = (flipper.get("settings") or {}).get("depth_m")
    if isinstance(depth_m, int | float) and abs(depth_m - settings.depth_m) > 1e-6:
        text += (
            f"\n\nThe flipper went {100.0 * depth_m:g} cm deep and the load cell {100.0 * settings.depth_m:g} cm: "
            "coefficients of one mud differ with the depth, so these cannot be compared."
        )
    return text


def make_sections(results: Results, plan: TrialPlan, flipper: Mapping[str, Any]) -> list[Section]:
    """`flipper` is the summary of the experiment that is compared, or empty."""
    rows, draw = coefficient_rows(results.muds), partial(plot_coefficients, results.muds)
    figures = [Figure("coefficients", "Mean of the trials with two standard errors; grey: every trial.", draw)]
    text = "\n\n".join([METHOD, *position_texts(results.trials), errors_text(results.muds, plan)])
    sections = [Section("Coefficients", text, rows=rows, figures=figures)]
    if results.compared:
        rows, text = compared_rows(results.compared), comparison_text(flipper, plan.settings)
        sections.append(Section("Compared with the flipper", text, rows=rows))
    if results.remarks:
        sections.append(Section("Remarks", "\n\n".join(results.remarks)))
    for mud, coefficients in results.muds.items():
        sections.append(_mud_section(results.trials, mud, coefficients, plan.settings))
    return sections


def position_texts(trials: Sequence[AnalysedTrial]) -> list[str]:
    """Explain how the position was measured, or that it was not."""
    measured = [trial for trial in trials if trial.is_measured]
    aligned = [trial.alignment for trial in measured if trial.alignment is not None]
    insertions = [trial for trial in measured if isinstance(trial.motion, Insertion)]
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


def _mud_section(
    trials: Sequence[AnalysedTrial], mud: str, coefficients: Mapping[str, MudCoefficient], settings: StageSettings
) -> Section:
    own = [trial for trial in trials if trial.recorded.mud == mud]
    caption = (
        f"Mud {mud_text(mud)}: measured (solid, one colour a trial) and modelled with the mud's coefficients (red, "
        "dashed)."
    )
    name = re.sub(r"[^\w.]+", "_", f"mud_{mud}")
    figure = Figure(name, caption, partial(plot_mud, own, coefficients, settings))
    return Section(f"Mud {mud_text(mud)}", rows=trial_rows(own), figures=[figure])


def coefficient_rows(muds: Mapping[str, Mapping[str, MudCoefficient]]) -> list[list[str]]:
    head = ["mud"]
    for name in COEFFICIENTS:
        head += [f"{name} (N/cm³)", "repeatability"]
    rows = [head]
    for mud, coefficients in muds.items():
        rows.append([mud_text(mud)])
        for each in (coefficients[name] for name in COEFFICIENTS):
            rows[-1].append(value_text(each.value, each.trials_error, each.shared_error, per=N_CM3))
            rows[-1].append(repeatability_text(each.repeatability, len(each.trials)))
    return rows


def trial_rows(trials: Sequence[AnalysedTrial]) -> list[list[str]]:
    head = ["trial", *(f"{name} (N/cm³)" for name in COEFFICIENTS), "speed (m/s)", "measured (cm)", "remark"]
    rows = []
    for trial in trials:
        estimates = [trial.coefficients.get(name) for name in COEFFICIENTS]
        cells = ["" if each is None else value_text(each.value, each.std_error, per=N_CM3) for each in estimates]
        speed = "-" if trial.speed_m_s is None or not isfinite(trial.speed_m_s) else f"{trial.speed_m_s:.3f}"
        label = f"{trial.recorded.kind} {trial.recorded.key.rsplit('/', 1)[-1]}"
        farthest = "-"  # the depth of an insertion, or the travel of a shear
        if trial.positions_m is not None:
            farthest = value_text(100.0 * float(np.nanmax(trial.positions_m)), 100.0 * trial.position_error_m)
        rows.append([label, *cells, speed, farthest, trial.problem or trial.remark])
    return [head, *rows]


def compared_rows(compared: Sequence[Compared]) -> list[list[str]]:
    head = ["mud", "", "flipper (N/cm³)", "load cell (N/cm³)", "flipper / load cell"]
    return [
        head,
        *(
            [
                mud_text(row.mud),
                row.coefficient,
                ("≥ " if row.at_least else "") + value_text(row.sensed, row.sensed_std_error, per=N_CM3),
                value_text(row.truth, row.truth_std_error, per=N_CM3),
                ("≥ " if row.at_least else "") + value_text(row.ratio, row.ratio_std_error),
            ]
            for row in compared
        ),
    ]


def make_tables(results: Results) -> list[TitledRows]:
    tables: list[TitledRows] = [(HEADING, coefficient_rows(results.muds))]
    return tables + [(COMPARED, compared_rows(results.compared))] * bool(results.compared)
