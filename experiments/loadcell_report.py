"""The load cell's results as sections of a report, and as text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from math import isfinite
from pathlib import Path

from experiments.loadcell import Compared, Results
from experiments.loadcell_fits import COEFFICIENTS, Analysed, OfMud
from experiments.loadcell_motion import StageSettings
from experiments.report_page import Figure, Section

TITLE = "Ground truth of mud from a load cell"
METHOD = (
    "A plate on a load cell is dragged through the mud, and in other trials let down, held and drawn out (the paper's "
    "section II-E). The stage is not connected: when it moved, and how fast, is found from the force's own course. "
    "k_p and k_e are fitted by F = k V over the way down and over the last three quarters of the way up, V being the "
    "submerged volume; k_s by F = k ∫ζ dA to the mean over the second half of the drag.\n\n"
    "The depth that was set counts as true: a millimetre in 3 cm is 3 % of k_p and k_e and 7 % of k_s. The paper gives "
    "its coefficients in figures only, so none of its values stand beside these."
)
COMPARISON = (
    "On the grey line the flipper senses what the load cell measures. The flipper's plate leans and crosses the mud at "
    "an angle, and may be another than the load cell's: see the table of plates in `mudskipper experiment estimation`."
)


def sections_of(results: Results, settings: StageSettings) -> list[Section]:
    rows, figures = coefficient_rows(results.muds), _coefficient_figures(results)
    sections = [Section("Coefficients", METHOD, rows=rows, figures=figures)]
    if results.compared:
        rows, figures = compared_rows(results.compared), _pairs(results)
        sections.append(Section("Compared with the flipper", COMPARISON, rows=rows, figures=figures))
    if results.remarks:
        sections.append(Section("What should be known", "\n\n".join(results.remarks)))
    for mud, told in results.muds.items():
        sections.append(_mud_section(results.trials, mud, told, settings))
    return sections


def _coefficient_figures(results: Results) -> list[Figure]:
    def draw(path: Path) -> None:
        from experiments.loadcell_plots import plot_coefficients  # matplotlib takes its time

        plot_coefficients(results.muds, path)

    return [Figure("coefficients", "Mean of the trials with two standard errors; grey: every trial.", draw)]


def _pairs(results: Results) -> list[Figure]:
    def draw(path: Path) -> None:
        from experiments.loadcell_plots import plot_comparison

        plot_comparison(results.compared, path)

    return [Figure("comparison", "Flipper against load cell, two standard errors; grey: both are equal.", draw)]


def _mud_section(trials: Sequence[Analysed], mud: str, told: Mapping[str, OfMud], settings: StageSettings) -> Section:
    of_it = [trial for trial in trials if trial.recorded.mud == mud]
    caption = f"Mud {mud}: measured (solid, one colour a trial) and modelled with the mud's coefficients (red, dashed)."
    name = re.sub(r"[^\w.]+", "_", f"mud_{mud}")
    figure = Figure(name, caption, partial(_draw_mud, of_it, told, settings))
    return Section(f"Mud {mud}", rows=trial_rows(of_it), figures=[figure])


def _draw_mud(trials: Sequence[Analysed], told: Mapping[str, OfMud], settings: StageSettings, path: Path) -> None:
    from experiments.loadcell_plots import plot_mud

    plot_mud(trials, told, settings, path)


def coefficient_rows(muds: Mapping[str, Mapping[str, OfMud]]) -> list[list[str]]:
    head = ["mud"]
    for name in COEFFICIENTS:
        head += [f"{name} N/cm³", "repeatability", "trials"]
    return [head, *([mud, *_cells(told)] for mud, told in muds.items())]


def _cells(told: Mapping[str, OfMud]) -> list[str]:
    cells = []
    for name in COEFFICIENTS:
        each = told[name]
        cells += [_with_error(each.value, each.std_error, 1e6), _percent(each.repeatability), str(len(each.trials))]
    return cells


def trial_rows(trials: Sequence[Analysed]) -> list[list[str]]:
    head = ["trial", *(f"{name} N/cm³" for name in COEFFICIENTS), "speed m/s", "remark"]
    rows = []
    for trial in trials:
        told = [trial.coefficients.get(name) for name in COEFFICIENTS]
        cells = ["" if each is None else _with_error(each.value, each.std_error, 1e6) for each in told]
        speed = "-" if trial.speed_m_s is None or not isfinite(trial.speed_m_s) else f"{trial.speed_m_s:.3f}"
        label = f"{trial.recorded.kind} {trial.recorded.key.rsplit('/', 1)[-1]}"
        rows.append([label, *cells, speed, trial.problem or trial.remark])
    return [head, *rows]


def compared_rows(compared: Sequence[Compared]) -> list[list[str]]:
    head = ["mud", "", "flipper N/cm³", "load cell N/cm³", "flipper / load cell"]
    return [
        head,
        *(
            [
                row.mud,
                row.coefficient,
                ("≥ " if row.at_least else "") + _with_error(row.sensed, row.sensed_std_error, 1e6),
                _with_error(row.truth, row.truth_std_error, 1e6),
                ("≥ " if row.at_least else "") + _with_error(row.ratio, row.ratio_std_error, 1.0),
            ]
            for row in compared
        ),
    ]


def _with_error(value: float, error: float, per: float) -> str:
    return f"{value / per:.3f} ± {error / per:.3f}" if isfinite(value) else "-"


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %" if isfinite(share) else "-"
