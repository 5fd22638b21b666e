"""The load cell's results as sections of a report, and as text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from experiments.loadcell.alignment import common_alignment
from experiments.loadcell.comparison import OTHER_PLATE, Compared
from experiments.loadcell.fits import CALLIPERS_M, COEFFICIENTS, Analysed, OfMud
from experiments.loadcell.measurement import Results
from experiments.loadcell.motion import RATE_EXPONENT, Insertion, StageSettings
from experiments.loadcell.trials import TrialPlan
from experiments.reports.mud_names import mud_text
from experiments.reports.report_page import Figure, Section
from experiments.reports.value_text import N_CM3, repeatability_text, value_text

TITLE = "Ground truth of mud from a load cell"
METHOD = (
    "A plate on a load cell is dragged through the mud, and in other trials let down, held and drawn out (the paper's "
    "section II-E). k_p and k_e are fitted by F = k V over the way down and over the last three quarters of the way "
    "up, V being the submerged volume; k_s by F = k ∫ζ dA to the mean over the second half of the drag.\n\n"
    "The paper gives its coefficients in figures only, so none of its values stand beside these."
)
UNCONNECTED = (
    "The stage is not connected: when it moved, and how fast, is found from the force's own course, as that of a stage "
    "of one speed."
)
MEASURED = (
    "The stage's place came from an encoder. k_p and k_e are fitted against the measured depth, from the surface that "
    "the force tells, over the samples in which the stage moved and had moved for 2 mm since it last rested; k_s to "
    "the mean over the second half of the measured way, 5 mm behind a rest. Mud bears more the faster it is: how much, "
    "the drags tell, and the coefficients are those at the speed that was set."
)
HEADING = "Coefficients ± one standard error of the trials ± one of the bench; what each holds: see the report"
COMPARED = "Flipper beside load cell; how far other plates and ways alone tell other coefficients: see the report"


def errors_text(muds: Mapping[str, Mapping[str, OfMud]], plan: TrialPlan) -> str:
    """What the doubts are that stand behind the values."""
    fractions = ", ".join(f"{100.0 * _largest_bench_fraction(muds, name):.1f} % of {name}" for name in COEFFICIENTS)
    return (
        "The first ± is one standard error of the trials: their scatter with Student's factor or what each doubts of "
        "samples, speed, surface, lag and rate, whichever is more. Two of it hold the truth in 19 of 20 cases or more, "
        "but for k_s without an encoder, whose trials agree better than the calibration is known. That the force does "
        "not grow as V is no part of it: k is what least squares make of the mud's own course, and belongs to its "
        "depth. The second ± is what no repetition shows, since all trials "
        f"have it alike: {_depth_text(plan)}, callipers ± {1000.0 * CALLIPERS_M:g} mm on width and thickness, and the "
        f"reading of the calibration, together at most {fractions}. The weights themselves count as exact, and so "
        "does an amplifier that prints grams or newtons by itself. A depth that an encoder "
        "measured has no doubt of a ruler."
    )


def _largest_bench_fraction(muds: Mapping[str, Mapping[str, OfMud]], name: str) -> float:
    coefficients = [reported[name] for reported in muds.values()]
    return max((each.shared_error / each.value for each in coefficients if isfinite(each.value)), default=0.0)


def _depth_text(plan: TrialPlan) -> str:
    return f"depth ± {1000.0 * plan.depth_error_m:g} mm (--depth-error)"


def comparison_text(results: Results, settings: StageSettings) -> str:
    flipper, own = results.flipper, _plate_text(asdict(settings), "plate_")
    plate = flipper.get("plate_m")
    other = _plate_text(plate, "", "") if isinstance(plate, dict) else "a plate that its summary does not tell"
    reported = (
        f"On the grey line the flipper senses what the load cell measures. The load cell carried {own}, upright; the "
        f"flipper {other}, leaning. {OTHER_PLATE} What is apart beyond that is the flipper's error."
    )
    depth_m = (flipper.get("settings") or {}).get("depth_m")
    if isinstance(depth_m, int | float) and abs(depth_m - settings.depth_m) > 1e-6:
        reported += (
            f"\n\nThe flipper went {100.0 * depth_m:g} cm deep and the load cell {100.0 * settings.depth_m:g} cm: "
            "coefficients of one mud differ with the depth, so these do not belong together."
        )
    return reported


def _plate_text(reported: Mapping[str, Any], before: str, after: str = "_m") -> str:
    sides = [reported.get(f"{before}{side}{after}") for side in ("width", "height", "thickness")]
    if not all(isinstance(side, int | float) for side in sides):
        return "a plate that its summary does not tell"
    width_m, height_m, thickness_m = (float(side) for side in sides if side is not None)
    return f"a plate of {100.0 * width_m:g} x {100.0 * height_m:g} cm, {1000.0 * thickness_m:g} mm thick"


def sections_of(results: Results, plan: TrialPlan) -> list[Section]:
    rows, figures = coefficient_rows(results.muds), _coefficient_figures(results)
    text = "\n\n".join([METHOD, *position_texts(results.trials), errors_text(results.muds, plan)])
    sections = [Section("Coefficients", text, rows=rows, figures=figures)]
    if results.compared:
        rows, figures = compared_rows(results.compared), _pairs(results)
        text = comparison_text(results, plan.settings)
        sections.append(Section("Compared with the flipper", text, rows=rows, figures=figures))
    if results.remarks:
        sections.append(Section("What should be known", "\n\n".join(results.remarks)))
    for mud, reported in results.muds.items():
        sections.append(_mud_section(results.trials, mud, reported, plan.settings))
    return sections


def position_texts(trials: Sequence[Analysed]) -> list[str]:
    """How the place was measured, and how well a sample's place is known; or that it was not."""
    measured = [trial for trial in trials if trial.is_measured]
    aligned = [trial.alignment for trial in measured if trial.alignment is not None]
    insertions = [trial for trial in measured if isinstance(trial.motion, Insertion)]
    if not measured:
        return [UNCONNECTED]
    if not aligned or not insertions:
        return [MEASURED]
    common, worst_m = common_alignment(aligned), max(trial.position_error_m for trial in insertions)
    without = len(trials) - len(measured)
    alone = f" {without} trials have no place: theirs is found from the force." if without else ""
    return [
        f"{MEASURED}{alone}",
        f"Forces are stamped {1000.0 * common.lag_s:.1f} ± {1000.0 * common.lag_uncertainty_s:.1f} ms later than "
        "places, as the strokes themselves tell; this and straight lines between the encoder's lines leave the depth "
        "of a sample "
        f"known to within ± {1000.0 * worst_m:.2f} mm in the worst trial. Twice as fast, the mud bears "
        f"{100.0 * common.rate_fraction * (2.0**RATE_EXPONENT - 1.0):.0f} % more.",
    ]


def _coefficient_figures(results: Results) -> list[Figure]:
    def draw(path: Path) -> None:
        from experiments.loadcell.plots import plot_coefficients  # matplotlib takes its time

        plot_coefficients(results.muds, path)

    return [Figure("coefficients", "Mean of the trials with two standard errors; grey: every trial.", draw)]


def _pairs(results: Results) -> list[Figure]:
    def draw(path: Path) -> None:
        from experiments.loadcell.plots import plot_comparison

        plot_comparison(results.compared, path)

    return [Figure("comparison", "Flipper against load cell, two standard errors; grey: both are equal.", draw)]


def _mud_section(
    trials: Sequence[Analysed], mud: str, reported: Mapping[str, OfMud], settings: StageSettings
) -> Section:
    of_it = [trial for trial in trials if trial.recorded.mud == mud]
    caption = (
        f"Mud {mud_text(mud)}: measured (solid, one colour a trial) and modelled with the mud's coefficients (red, "
        "dashed)."
    )
    name = re.sub(r"[^\w.]+", "_", f"mud_{mud}")
    figure = Figure(name, caption, partial(_draw_mud, of_it, reported, settings))
    return Section(f"Mud {mud_text(mud)}", rows=trial_rows(of_it), figures=[figure])


def _draw_mud(trials: Sequence[Analysed], reported: Mapping[str, OfMud], settings: StageSettings, path: Path) -> None:
    from experiments.loadcell.plots import plot_mud

    plot_mud(trials, reported, settings, path)


def coefficient_rows(muds: Mapping[str, Mapping[str, OfMud]]) -> list[list[str]]:
    head = ["mud"]
    for name in COEFFICIENTS:
        head += [f"{name} (N/cm³)", "repeatability"]
    return [head, *([mud_text(mud), *_cells(reported)] for mud, reported in muds.items())]


def _cells(reported: Mapping[str, OfMud]) -> list[str]:
    cells = []
    for name in COEFFICIENTS:
        each = reported[name]
        cells.append(value_text(each.value, each.trials_error, each.shared_error, per=N_CM3))
        cells.append(repeatability_text(each.repeatability, len(each.trials)))
    return cells


def trial_rows(trials: Sequence[Analysed]) -> list[list[str]]:
    head = ["trial", *(f"{name} (N/cm³)" for name in COEFFICIENTS), "speed (m/s)", "measured (cm)", "remark"]
    rows = []
    for trial in trials:
        reported = [trial.coefficients.get(name) for name in COEFFICIENTS]
        cells = ["" if each is None else value_text(each.value, each.std_error, per=N_CM3) for each in reported]
        speed = "-" if trial.speed_m_s is None or not isfinite(trial.speed_m_s) else f"{trial.speed_m_s:.3f}"
        label = f"{trial.recorded.kind} {trial.recorded.key.rsplit('/', 1)[-1]}"
        rows.append([label, *cells, speed, _farthest(trial), trial.problem or trial.remark])
    return [head, *rows]


def _farthest(trial: Analysed) -> str:
    """Depth of an insertion, way of a shear."""
    if trial.positions_m is None:
        return "-"
    return value_text(100.0 * float(np.nanmax(trial.positions_m)), 100.0 * trial.position_error_m)


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


def text_of(results: Results) -> list[tuple[str, Sequence[Sequence[str]]]]:
    """Titles and tables for the screen."""
    tables: list[tuple[str, Sequence[Sequence[str]]]] = [(HEADING, coefficient_rows(results.muds))]
    return tables + [(COMPARED, compared_rows(results.compared))] * bool(results.compared)
