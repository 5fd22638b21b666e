"""The evaluation of real logs as pictures, with one row of panels for each method."""

from collections.abc import Callable, Mapping, Sequence
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.lablogs.comparisons import disturbed_values, flipper_pairs
from experiments.lablogs.estimates import DELAY_S, EARLY, LATE, METHODS, MISSING, MISSING_ROWS, RECORDED, strokes_of
from experiments.lablogs.repeatability import Scatter, scatter_between_strokes, scatter_between_trials
from experiments.lablogs.report import members_of
from experiments.reports.mud_styles import LABELS, MARKS, name_decades
from experiments.reports.style import FAINT, INK, WIDTH_IN, say_empty
from experiments.reports.value_text import N_CM3

COLOURS = dict(zip(COEFFICIENTS, ("C0", "C1", "C2"), strict=True))
WIDEST = 5.0  # standard deviations in the histogram; larger ones are drawn at its edge
DODGE = 0.08  # between the trials of one stroke
SMALL: dict[str, Any] = {"fontsize": "small"}


def draw_strokes(estimates: DataFrame) -> Figure:
    """Draw k_s by stroke and trial, a panel for each group on a fixed base."""

    def draw(panel: Axes, strokes: Mapping[str, DataFrame], group: str) -> None:
        own = strokes[group]
        _draw_trials(panel, own[own["coefficient"] == "k_s"])

    first = _strokes_by_group(estimates[estimates["method"] == METHODS[0]])
    groups = {name: name for name, own in first.items() if len(own)}
    figure = _draw_panels(estimates, groups, _strokes_by_group, draw, ("stroke", "$k_s$ (N/cm³)"), sharey="row")
    for panel in figure.axes[:: max(len(groups), 1)]:
        panel.set_ylim(bottom=0.0)
    return figure


def _strokes_by_group(estimates: DataFrame) -> dict[str, DataFrame]:
    recorded = estimates[estimates["disturbance"] == RECORDED]
    return {name: strokes_of(own) for name, own in members_of(recorded).items()}


def _draw_trials(panel: Axes, strokes: DataFrame) -> None:
    trials = strokes["trial"].nunique()
    for number, (_, trial) in enumerate(strokes.groupby("trial")):
        style: dict[str, Any] = {"fmt": MARKS[number % len(MARKS)], "color": f"C{number}", "markersize": 5}
        drawn = trial[trial["kind"] != "invalid"]
        x = drawn["stroke"] + 1 + DODGE * (number - (trials - 1) / 2.0)
        bounds = drawn["kind"] == "bound"  # an arrow upward
        values, errors = drawn["value"] / N_CM3, drawn["repeatability"] / N_CM3
        panel.errorbar(x, values, errors, lolims=bounds, linewidth=1, capsize=2, **style)


def draw_scatter(estimates: DataFrame) -> Figure:
    """Draw histograms of the deviations in claimed errors, over the groups on a fixed base."""
    axis_names = "deviation / claimed error", "number of strokes"
    figure = _draw_panels(estimates, LABELS, _strokes_by_group, _draw_deviations, axis_names)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, **SMALL)
    return figure


def _draw_deviations(panel: Axes, groups: Mapping[str, DataFrame], coefficient: str) -> None:
    strokes = [own[own["coefficient"] == coefficient] for own in groups.values()]
    deviations = [
        _standardized([scatter_between_trials(each) for each in strokes]),
        _standardized([scatter_between_strokes(each) for each in strokes]),
    ]
    edges, x = np.linspace(-WIDEST, WIDEST, 21).tolist(), np.linspace(-WIDEST, WIDEST, 201)
    panel.hist(deviations, edges, stacked=True, color=(FAINT, "C0"), label=("between trials", "between strokes"))
    expected = sum(map(len, deviations)) * (edges[1] - edges[0])
    panel.plot(x, expected * np.exp(-x * x / 2.0) / np.sqrt(2.0 * pi), color=INK, label="normal")


def _standardized(scatters: Sequence[Scatter]) -> NDArray[np.float64]:
    """Return the deviations, enlarged by what the fitted means took from them."""
    enlarged = [
        scatter.deviations * np.sqrt(len(scatter.deviations) / scatter.dof) for scatter in scatters if scatter.dof > 0
    ]
    joined: NDArray[np.float64] = np.concatenate([np.empty(0), *enlarged])
    return joined.clip(-WIDEST, WIDEST)


def draw_left_right(estimates: DataFrame) -> Figure:
    """Draw the left flipper's values over the right one's."""
    recorded = estimates[(estimates["disturbance"] == RECORDED) & estimates["in_mud"].astype(bool)]
    return _draw_panels(recorded, LABELS, flipper_pairs, _draw_pairs, ("left (N/cm³)", "right (N/cm³)"))


def _draw_pairs(panel: Axes, pairs: DataFrame, coefficient: str) -> None:
    is_drawn = (pairs["value_left"] > 0.0) & (pairs["value_right"] > 0.0)
    drawn = pairs[is_drawn & (pairs["coefficient"] == coefficient)]
    if drawn.empty:
        panel.set(xticks=[], yticks=[])
        say_empty(panel, "no pair of values")
        return
    left, right, left_error, right_error = (
        drawn[name] / N_CM3 for name in ("value_left", "value_right", "repeatability_left", "repeatability_right")
    )
    colour = COLOURS[coefficient]
    panel.errorbar(left, right, right_error, left_error, fmt="o", color=colour, markersize=4, linewidth=1)
    ends = [0.8 * min(left.min(), right.min()), 1.25 * max(left.max(), right.max())]
    panel.plot(ends, ends, color=FAINT, linewidth=1)
    panel.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    for axis in (panel.xaxis, panel.yaxis):
        name_decades(axis)


def draw_sensitivity(estimates: DataFrame) -> Figure:
    """Draw disturbed over recorded values, a panel for each disturbance."""
    disturbances = {
        LATE: f"current {1000.0 * DELAY_S:g} ms late",
        EARLY: f"current {1000.0 * DELAY_S:g} ms early",
        MISSING: f"{100.0 * MISSING_ROWS:g} % of the rows missing",
    }
    mud = estimates[estimates["in_mud"].astype(bool)]
    return _draw_panels(mud, disturbances, disturbed_values, _draw_ratios, ("", "disturbed / recorded"), sharey=True)


def _draw_ratios(panel: Axes, changes: DataFrame, disturbance: str) -> None:
    drawn = changes[(changes["disturbance"] == disturbance) & (changes["ratio"] > 0.0)]
    for number, name in enumerate(COEFFICIENTS):
        ratios = drawn.loc[drawn["coefficient"] == name, "ratio"].sort_values()
        x = number + np.linspace(-0.3, 0.3, len(ratios))
        panel.plot(x, ratios, ".", color=COLOURS[name], markersize=4)
    panel.axhline(1.0, color=FAINT, linewidth=1)
    panel.set_yscale("log")
    panel.set_xticks(range(len(COEFFICIENTS)), [LABELS[name] for name in COEFFICIENTS], **SMALL)


def _draw_panels(
    estimates: DataFrame,
    columns: Mapping[str, str],
    prepare: Callable[[DataFrame], Any],
    draw: Callable[[Axes, Any, str], None],
    axis_names: tuple[str, str],
    **shared: Any,
) -> Figure:
    """Draw a row of panels for each method, from what `prepare` makes of its estimates; `columns` have a title each."""
    figure = Figure(figsize=(WIDTH_IN, 2.9 * len(METHODS)))
    rows = figure.subplots(len(METHODS), max(len(columns), 1), squeeze=False, **shared)
    for panels, method in zip(rows, METHODS, strict=True):
        prepared = prepare(estimates[estimates["method"] == method])
        for panel, (name, title) in zip(panels, columns.items(), strict=False):
            draw(panel, prepared, name)
            panel.set_title(f"{title}, method {method}", **SMALL)
            panel.set_xlabel(axis_names[0])
        panels[0].set_ylabel(axis_names[1])
    return figure
