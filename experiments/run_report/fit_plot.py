"""Draws every fit with its residuals next to it, the left flipper next to the right one, after the law τ = k Φ.

Moments in cm⁴ and torques in N·cm make the slope of a line the coefficient in N/cm³.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from estimation.strokes.fit_samples import FitSamples
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_styles import LABELS, looks_of
from experiments.reports.style import FAINT, STYLE
from experiments.reports.value_text import N_CM3
from experiments.run_report.fit_quality import N_CM
from experiments.run_report.run import ReportedStride, Run

CM4 = 1e8  # in m⁴
MOST_DRAWN = 10  # strides of each mud, evenly over the run
MOST_MUDS = 12  # a robot on its own notices hundreds in an hour
LEGEND_COLUMN_IN = 2.8  # "k_p 1.4 N/cm³, from 3200 s" with its mark
INSIDE, BEYOND = 2.0, 0.6  # percentiles of the samples, and how far of their range a sample may be beyond them
WIDTH_IN, HEIGHT_IN, DOTS_PER_INCH = (6.0, 10.0), 7.2, 120  # with one flipper, and with two


def plot_fits(run: Run, path: Path) -> Figure:
    """Draw into a PNG, SVG or PDF file."""
    muds = drawn_muds(run)
    looks, width_in = looks_of(muds), WIDTH_IN[len(run.flippers) - 1]
    with rc_context(STYLE):
        figure = Figure(figsize=(width_in, HEIGHT_IN), layout="constrained")
        axes = figure.subplots(len(COEFFICIENTS), 2 * len(run.flippers), squeeze=False)
        for row, name in zip(axes, COEFFICIENTS, strict=True):
            for fit, residuals, flipper in zip(row[::2], row[1::2], run.flippers, strict=True):
                _draw_fits(fit, residuals, drawn_samples(run, flipper, name), looks)
                fit.set_title(f"{LABELS[name]}, {flipper}", size="medium")
                residuals.set_title("residuals", size="medium")
            _share_scales(row)
            row[0].set_ylabel("torque (N·cm)")
        for panel in axes[-1]:
            panel.set_xlabel("moment (cm⁴)")
        handles = [axes[0, 0].plot([], [], **_mark(looks[mud]), label=mud.replace("k_p", "$k_p$"))[0] for mud in muds]
        columns = min(max(len(muds), 1), int(width_in / LEGEND_COLUMN_IN))
        figure.legend(handles=handles, loc="outside upper center", ncols=columns, frameon=False)
        figure.savefig(path, dpi=DOTS_PER_INCH)
    return figure


def drawn_muds(run: Run) -> list[str]:
    """Return the muds with the most strides in the order of the run, at most MOST_MUDS."""
    strides = Counter(stride.mud for stride in run.strides if stride.mud)
    drawn = {mud for mud, _ in strides.most_common(MOST_MUDS)}
    return [mud for mud in strides if mud in drawn]


def drawn_samples(run: Run, flipper: str, name: str) -> Iterator[tuple[str, list[FitSamples]]]:
    """Yield each drawn mud with the samples of at most MOST_DRAWN of its strides."""
    by_mud: dict[str, list[ReportedStride]] = {}
    muds = drawn_muds(run)
    for stride in run.strides:
        if stride.mud in muds and stride.samples(flipper, name):
            by_mud.setdefault(stride.mud, []).append(stride)
    for mud, strides in by_mud.items():
        drawn = np.unique(np.linspace(0, len(strides) - 1, MOST_DRAWN).round().astype(int))
        yield mud, [samples for number in drawn if (samples := strides[number].samples(flipper, name))]


def _draw_fits(
    fit: Axes, residuals: Axes, drawn: Iterator[tuple[str, list[FitSamples]]], looks: Mapping[str, dict[str, Any]]
) -> None:
    """Draw all strides of a mud as one artist of each kind: one of its own takes ten kilobytes."""
    for mud, strides in drawn:
        samples = [(each.moments_m4, each.torques_nm, each.residuals_nm) for each in strides]
        moments, torques, remains = (np.concatenate(parts) for parts in zip(*samples, strict=True))
        ends = [(max(each.moments_m4), each.slope / N_CM3) for each in strides]
        lines = [([0.0, CM4 * end, nan], [0.0, slope * CM4 * end, nan]) for end, slope in ends]
        fit.plot(CM4 * moments, N_CM * torques, **_mark(looks[mud]))
        fit.plot(*np.hstack(lines), color=looks[mud]["color"], linewidth=0.8)
        residuals.plot(CM4 * moments, N_CM * remains, **_mark(looks[mud]))
    residuals.axhline(0.0, color=FAINT, linewidth=0.8)


def _mark(look: Mapping[str, Any]) -> dict[str, Any]:
    return {"color": look["color"], "marker": look["marker"], "markersize": 3.0, "alpha": 0.7, "linestyle": ""}


def _share_scales(row: Sequence[Axes]) -> None:
    """Give fits, and residuals, of both flippers the same scales."""
    for panels in (row[::2], row[1::2]):
        for panel in panels[1:]:
            panel.sharex(panels[0])
            panel.sharey(panels[0])
        panels[0].autoscale()
        marks = [line for panel in panels for line in panel.lines if line.get_marker() != "None"]
        _cut_outliers(panels, [np.asarray(line.get_ydata(), dtype=float) for line in marks])


def _cut_outliers(panels: Sequence[Axes], heights: Sequence[NDArray[np.float64]]) -> None:
    """Leave single samples far off out of the picture, and count them in it."""
    if not heights:
        return
    low, high = np.percentile(np.concatenate(heights), [INSIDE, 100.0 - INSIDE])
    room = BEYOND * (high - low)
    bottom, top = panels[0].get_ylim()
    bottom, top = max(bottom, float(low - room)), min(top, float(high + room))
    if not bottom < top:
        return
    panels[0].set_ylim(bottom, top)
    for panel in panels:
        values = [y for line in panel.lines if line.get_marker() != "None" for y in np.asarray(line.get_ydata())]
        if outside := sum(not bottom <= y <= top for y in values):
            panel.annotate(f"{outside} beyond", (0.98, 0.02), xycoords="axes fraction", ha="right", size=7, color=FAINT)
