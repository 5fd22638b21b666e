"""The evaluation of real logs as pictures, with one row of panels for each method."""

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from experiments.lablogs.consistency import FlipperPair, flipper_pairs
from experiments.lablogs.lab_trial import DELAY_S, METHODS, MISSING_ROWS, LabTrial, Strides
from experiments.lablogs.repeatability import Scatter, scatter_between_strokes, scatter_between_trials
from experiments.lablogs.report import Groups, strokes_of
from experiments.lablogs.sensitivity import Change, early_changes, late_changes, missing_changes
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_styles import GREY, INK, LABELS, MARKS

COLOURS = dict(zip(COEFFICIENTS, ("tab:blue", "tab:red", "tab:green"), strict=True))
PER_CM3 = 1e6  # N/m³
WIDEST = 5.0  # standard deviations in the histogram; larger ones are drawn at its edge
DODGE = 0.08  # between the trials of one stroke
SMALL: dict[str, Any] = {"fontsize": "small"}


def draw_strokes(members: Groups) -> Figure:
    """Draw k_s by stroke and trial, a panel for each group on a fixed base."""
    groups = {name: [each for each in trials if each.fixed_base] for name, trials in members.items()}
    groups = {name: trials for name, trials in groups.items() if trials}
    figure, panels = _panels(max(len(groups), 1), sharey="row")
    for row, method in zip(panels, METHODS, strict=True):
        for panel, (name, trials) in zip(row, groups.items(), strict=False):
            _draw_trials(panel, [strokes for trial in trials for strokes in trial.strokes(method)])
            panel.set_title(f"{name}, method {method}", **SMALL)
            panel.set_xlabel("stroke")
        row[0].set_ylabel("$k_s$ (N/cm³)")
        row[0].set_ylim(bottom=0.0)
    return figure


def _draw_trials(panel: Axes, trials: Sequence[Strides]) -> None:
    for number, strides in enumerate(trials):
        style: dict[str, Any] = {"fmt": MARKS[number % len(MARKS)], "color": f"C{number}", "markersize": 5}
        strokes = [(i, stride.k_s) for i, stride in enumerate(strides, 1) if stride.k_s.valid]
        x = np.array([i for i, _ in strokes]) + DODGE * (number - (len(trials) - 1) / 2.0)
        values, errors = ([getattr(k_s, name) / PER_CM3 for _, k_s in strokes] for name in ("value", "std_error"))
        bounds = [k_s.at_least for _, k_s in strokes]  # an arrow upward
        panel.errorbar(x, values, errors, lolims=bounds, linewidth=1, capsize=2, **style)


def draw_scatter(trials_by_group: Groups) -> Figure:
    """Draw histograms of the deviations in claimed errors, over the groups on a fixed base."""
    figure, panels = _panels(len(COEFFICIENTS))
    groups = list(trials_by_group.values())
    for row, method in zip(panels, METHODS, strict=True):
        for panel, name in zip(row, COEFFICIENTS, strict=True):
            strokes = [strokes_of(trials, method, name) for trials in groups]
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
        np.array(scatter.deviations) * np.sqrt(len(scatter.deviations) / scatter.dof)
        for scatter in scatters
        if scatter.dof > 0
    ]
    joined: NDArray[np.float64] = np.concatenate([np.empty(0), *enlarged])
    return joined.clip(-WIDEST, WIDEST)


def _draw_histogram(panel: Axes, deviations: Sequence[NDArray[np.float64]]) -> None:
    edges, x = np.linspace(-WIDEST, WIDEST, 21).tolist(), np.linspace(-WIDEST, WIDEST, 201)
    panel.hist(deviations, edges, stacked=True, color=(GREY, "tab:blue"), label=("between trials", "between strokes"))
    expected = sum(map(len, deviations)) * (edges[1] - edges[0])
    panel.plot(x, expected * np.exp(-x * x / 2.0) / np.sqrt(2.0 * pi), color=INK, label="normal")


def draw_left_right(mud: Sequence[LabTrial]) -> Figure:
    """Draw the left flipper's values over the right one's."""
    figure, panels = _panels(len(COEFFICIENTS))
    for row, method in zip(panels, METHODS, strict=True):
        pairs = flipper_pairs(mud, method)
        for panel, name in zip(row, COEFFICIENTS, strict=True):
            _draw_pairs(panel, [pair for pair in pairs if pair.coefficient == name], COLOURS[name])
            panel.set_title(f"{LABELS[name]}, method {method}", **SMALL)
            panel.set_xlabel("left (N/cm³)")
        row[0].set_ylabel("right (N/cm³)")
    return figure


def _draw_pairs(panel: Axes, pairs: Sequence[FlipperPair], colour: str) -> None:
    drawn = [pair for pair in pairs if min(pair.left.value, pair.right.value) > 0.0]
    if not drawn:
        return
    left, left_error = ([getattr(pair.left, name) / PER_CM3 for pair in drawn] for name in ("value", "std_error"))
    right, right_error = ([getattr(pair.right, name) / PER_CM3 for pair in drawn] for name in ("value", "std_error"))
    panel.errorbar(left, right, right_error, left_error, fmt="o", color=colour, markersize=4, linewidth=1)
    ends = [0.8 * min(*left, *right), 1.25 * max(*left, *right)]
    panel.plot(ends, ends, color=GREY, linewidth=1)
    panel.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")


def draw_sensitivity(mud: Sequence[LabTrial]) -> Figure:
    """Draw disturbed over recorded values, a panel for each disturbance."""
    disturbances = {
        f"current {1000.0 * DELAY_S:g} ms late": late_changes,
        f"current {1000.0 * DELAY_S:g} ms early": early_changes,
        f"{100.0 * MISSING_ROWS:g} % of the rows missing": missing_changes,
    }
    figure, panels = _panels(len(disturbances), sharey=True)
    for row, method in zip(panels, METHODS, strict=True):
        for panel, (name, find) in zip(row, disturbances.items(), strict=True):
            _draw_changes(panel, find(mud, method))
            panel.set_title(f"{name}, method {method}", **SMALL)
        row[0].set_ylabel("disturbed / recorded")
    return figure


def _draw_changes(panel: Axes, changes: Sequence[Change]) -> None:
    for number, name in enumerate(COEFFICIENTS):
        ratios = [c.ratio for c in changes if c.coefficient == name and c.ratio is not None and c.ratio > 0.0]
        x = number + np.linspace(-0.3, 0.3, len(ratios))
        panel.plot(x, sorted(ratios), ".", color=COLOURS[name], markersize=4)
    panel.axhline(1.0, color=GREY, linewidth=1)
    panel.set_yscale("log")
    panel.set_xticks(range(len(COEFFICIENTS)), [LABELS[name] for name in COEFFICIENTS], **SMALL)


def _panels(columns: int, **shared: Any) -> tuple[Figure, NDArray[Any]]:
    """Return a figure with a row of panels for each method."""
    figure = Figure(figsize=(3.4 * max(columns, 2), 2.9 * len(METHODS)))
    return figure, figure.subplots(len(METHODS), columns, squeeze=False, **shared)
