"""The evaluation of real logs as pictures, with one row of panels for each method."""

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray
from pandas import DataFrame

from experiments.lablogs.comparisons import disturbed_values, flipper_pairs
from experiments.lablogs.estimates import DELAY_S, EARLY, LATE, METHODS, MISSING, MISSING_ROWS, RECORDED, strokes_of
from experiments.lablogs.repeatability import Scatter, scatter_between_strokes, scatter_between_trials
from experiments.lablogs.report import members_of
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_styles import GREY, INK, LABELS, MARKS

COLOURS = dict(zip(COEFFICIENTS, ("tab:blue", "tab:red", "tab:green"), strict=True))
PER_CM3 = 1e6  # N/m³
WIDEST = 5.0  # standard deviations in the histogram; larger ones are drawn at its edge
DODGE = 0.08  # between the trials of one stroke
SMALL: dict[str, Any] = {"fontsize": "small"}


def draw_strokes(estimates: DataFrame) -> Figure:
    """Draw k_s by stroke and trial, a panel for each group on a fixed base."""
    strokes = {method: _strokes_by_group(estimates, method) for method in METHODS}
    groups = [name for name, own in strokes[METHODS[0]].items() if len(own)]
    figure, panels = _panels(max(len(groups), 1), sharey="row")
    for row, method in zip(panels, METHODS, strict=True):
        for panel, name in zip(row, groups, strict=False):
            own = strokes[method][name]
            _draw_trials(panel, own[own["coefficient"] == "k_s"])
            panel.set_title(f"{name}, method {method}", **SMALL)
            panel.set_xlabel("stroke")
        row[0].set_ylabel("$k_s$ (N/cm³)")
        row[0].set_ylim(bottom=0.0)
    return figure


def _strokes_by_group(estimates: DataFrame, method: str) -> dict[str, DataFrame]:
    return {name: strokes_of(own) for name, own in members_of(_recorded(estimates, method)).items()}


def _recorded(estimates: DataFrame, method: str) -> DataFrame:
    return estimates[(estimates["method"] == method) & (estimates["disturbance"] == RECORDED)]


def _draw_trials(panel: Axes, strokes: DataFrame) -> None:
    trials = strokes["trial"].nunique()
    for number, (_, trial) in enumerate(strokes.groupby("trial")):
        style: dict[str, Any] = {"fmt": MARKS[number % len(MARKS)], "color": f"C{number}", "markersize": 5}
        drawn = trial[trial["kind"] != "invalid"]
        x = drawn["stroke"] + 1 + DODGE * (number - (trials - 1) / 2.0)
        bounds = drawn["kind"] == "bound"  # an arrow upward
        values, errors = drawn["value"] / PER_CM3, drawn["repeatability"] / PER_CM3
        panel.errorbar(x, values, errors, lolims=bounds, linewidth=1, capsize=2, **style)


def draw_scatter(estimates: DataFrame) -> Figure:
    """Draw histograms of the deviations in claimed errors, over the groups on a fixed base."""
    figure, panels = _panels(len(COEFFICIENTS))
    for row, method in zip(panels, METHODS, strict=True):
        groups = _strokes_by_group(estimates, method).values()
        for panel, name in zip(row, COEFFICIENTS, strict=True):
            strokes = [own[own["coefficient"] == name] for own in groups]
            between_trials = [scatter_between_trials(each) for each in strokes]
            between_strokes = [scatter_between_strokes(each) for each in strokes]
            _draw_histogram(panel, [_standardized(between_trials), _standardized(between_strokes)])
            panel.set_title(f"{LABELS[name]}, method {method}", **SMALL)
            panel.set_xlabel("deviation / claimed error")
    panels[0][0].legend(**SMALL)
    return figure


def _standardized(scatters: Sequence[Scatter]) -> NDArray[np.float64]:
    """Return the deviations, enlarged by what the fitted means took from them."""
    enlarged = [
        scatter.deviations * np.sqrt(len(scatter.deviations) / scatter.dof) for scatter in scatters if scatter.dof > 0
    ]
    joined: NDArray[np.float64] = np.concatenate([np.empty(0), *enlarged])
    return joined.clip(-WIDEST, WIDEST)


def _draw_histogram(panel: Axes, deviations: Sequence[NDArray[np.float64]]) -> None:
    edges, x = np.linspace(-WIDEST, WIDEST, 21).tolist(), np.linspace(-WIDEST, WIDEST, 201)
    panel.hist(deviations, edges, stacked=True, color=(GREY, "tab:blue"), label=("between trials", "between strokes"))
    expected = sum(map(len, deviations)) * (edges[1] - edges[0])
    panel.plot(x, expected * np.exp(-x * x / 2.0) / np.sqrt(2.0 * pi), color=INK, label="normal")


def draw_left_right(estimates: DataFrame) -> Figure:
    """Draw the left flipper's values over the right one's."""
    figure, panels = _panels(len(COEFFICIENTS))
    for row, method in zip(panels, METHODS, strict=True):
        recorded = _recorded(estimates, method)
        pairs = flipper_pairs(recorded[recorded["in_mud"].astype(bool)])
        for panel, name in zip(row, COEFFICIENTS, strict=True):
            _draw_pairs(panel, pairs[pairs["coefficient"] == name], COLOURS[name])
            panel.set_title(f"{LABELS[name]}, method {method}", **SMALL)
            panel.set_xlabel("left (N/cm³)")
        row[0].set_ylabel("right (N/cm³)")
    return figure


def _draw_pairs(panel: Axes, pairs: DataFrame, colour: str) -> None:
    drawn = pairs[(pairs["value_left"] > 0.0) & (pairs["value_right"] > 0.0)]
    if drawn.empty:
        return
    left, right, left_error, right_error = (
        drawn[name] / PER_CM3 for name in ("value_left", "value_right", "repeatability_left", "repeatability_right")
    )
    panel.errorbar(left, right, right_error, left_error, fmt="o", color=colour, markersize=4, linewidth=1)
    ends = [0.8 * min(left.min(), right.min()), 1.25 * max(left.max(), right.max())]
    panel.plot(ends, ends, color=GREY, linewidth=1)
    panel.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")


def draw_sensitivity(estimates: DataFrame) -> Figure:
    """Draw disturbed over recorded values, a panel for each disturbance."""
    disturbances = {
        LATE: f"current {1000.0 * DELAY_S:g} ms late",
        EARLY: f"current {1000.0 * DELAY_S:g} ms early",
        MISSING: f"{100.0 * MISSING_ROWS:g} % of the rows missing",
    }
    figure, panels = _panels(len(disturbances), sharey=True)
    mud = estimates[estimates["in_mud"].astype(bool)]
    for row, method in zip(panels, METHODS, strict=True):
        changes = disturbed_values(mud[mud["method"] == method])
        for panel, (disturbance, title) in zip(row, disturbances.items(), strict=True):
            _draw_ratios(panel, changes[changes["disturbance"] == disturbance])
            panel.set_title(f"{title}, method {method}", **SMALL)
        row[0].set_ylabel("disturbed / recorded")
    return figure


def _draw_ratios(panel: Axes, changes: DataFrame) -> None:
    drawn = changes[changes["ratio"] > 0.0]
    for number, name in enumerate(COEFFICIENTS):
        ratios = drawn.loc[drawn["coefficient"] == name, "ratio"].sort_values()
        x = number + np.linspace(-0.3, 0.3, len(ratios))
        panel.plot(x, ratios, ".", color=COLOURS[name], markersize=4)
    panel.axhline(1.0, color=GREY, linewidth=1)
    panel.set_yscale("log")
    panel.set_xticks(range(len(COEFFICIENTS)), [LABELS[name] for name in COEFFICIENTS], **SMALL)


def _panels(columns: int, **shared: Any) -> tuple[Figure, NDArray[Any]]:
    """Return a figure with a row of panels for each method."""
    figure = Figure(figsize=(3.4 * max(columns, 2), 2.9 * len(METHODS)))
    return figure, figure.subplots(len(METHODS), columns, squeeze=False, **shared)
