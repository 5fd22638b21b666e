"""The walks as a picture: along the trackway as in the paper's figure 8, and Table I as bars and dots."""

from collections.abc import Mapping, Sequence
from itertools import accumulate, cycle
from math import nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from pandas import DataFrame

from experiments.reports.mud_names import mud_label
from experiments.trackway.table_one import ADAPTIVE, Summary
from experiments.trackway.walk import EXTRACTION, SLIPPAGE

COLOURS = {"3 cm": "tab:green", "5 cm": "tab:orange", ADAPTIVE: "tab:blue"}  # as in the paper
OTHERS = ("tab:red", "tab:purple", "tab:brown")
LINES, DOTS = ("-", "--", "-.", ":"), ("o", "s", "D", "^", "P", "*")  # the gaits, for print without colours
MUD_SHADES = ("#e9dfd0", "#f6f1e8", "#d8c7ad")
MARKS = {SLIPPAGE: "v", EXTRACTION: "X"}
TEXT = "#333333"
DOT: dict[str, Any] = {"markeredgecolor": "black", "markeredgewidth": 0.6, "markersize": 7}
UNREACHED = (nan, nan)
Styles = Mapping[str, dict[str, Any]]  # of each gait's line and dots


def draw_trackway(report: Summary) -> Figure:
    """Draw step length and depth along the track, and the speeds next to the paper's."""
    figure = Figure(figsize=(12.0, 5.6))
    axes = figure.subplot_mosaic(
        [["steps", "speeds"], ["depths", "speeds"]], width_ratios=(1.5, 1.0), height_ratios=(1.6, 1.0)
    )
    styles = _styles(list(report["table"]))
    _draw_walks(axes["steps"], report, styles, "step_cm")
    _name_steps(axes["steps"], report, styles)
    _draw_walks(axes["depths"], report, styles, "depth_cm")
    axes["depths"].set_ylabel("depth (cm)")
    axes["depths"].invert_yaxis()
    axes["depths"].set_xlabel("position along the track (cm)")
    _draw_speeds(axes["speeds"], report, styles)
    return figure


def _styles(gaits: Sequence[str]) -> Styles:
    others = cycle(OTHERS)
    return {
        gait: {
            "color": COLOURS[gait] if gait in COLOURS else next(others),
            "linestyle": LINES[i % len(LINES)],
            "marker": DOTS[i % len(DOTS)],
            "markersize": 4.0,
        }
        for i, gait in enumerate(gaits)
    }


def _mud_regions(report: Summary) -> list[tuple[str, float, float]]:
    """Return name, beginning and end of each mud in cm along the track."""
    lengths_cm = report["settings"]["mud_length_cm"]
    ends_cm = accumulate(lengths_cm.values())
    return [(mud, end - length, end) for (mud, length), end in zip(lengths_cm.items(), ends_cm, strict=True)]


def _draw_walks(panel: Axes, report: Summary, styles: Styles, key: str) -> None:
    """Draw the first walk of each gait on its muds."""
    for shade, (_, begin_cm, end_cm) in zip(cycle(MUD_SHADES), _mud_regions(report), strict=False):
        panel.axvspan(begin_cm, end_cm, color=shade, zorder=0)
    panel.set_xlim(0.0, end_cm)
    for gait, style in styles.items():
        for strides in report["walks"][gait][:1]:  # none where every trial was left out
            walk = DataFrame(strides, columns=["position_cm", key, "failure"])
            panel.plot(walk["position_cm"], walk[key], linewidth=1.4, **style)
            for failure, mark in MARKS.items():
                failed = walk[walk["failure"] == failure]
                panel.plot(failed["position_cm"], failed[key], mark, color=style["color"], **DOT)


def _name_steps(panel: Axes, report: Summary, styles: Styles) -> None:
    panel.set_ylabel("step length (cm)")
    low, high = panel.get_ylim()
    panel.set_ylim(min(0.0, low), high + 0.1 * (high - low))  # room for the muds' names
    across = panel.get_xaxis_transform()
    for mud, begin_cm, end_cm in _mud_regions(report):
        panel.text((begin_cm + end_cm) / 2.0, 0.97, mud_label(mud), transform=across, ha="center", va="top", color=TEXT)
    panel.set_title("One walk of each gait over the trackway")
    failures = {stride["failure"] for trials in report["walks"].values() for walk in trials[:1] for stride in walk}
    failed: dict[str, Any] = {"color": "lightgrey", "markeredgecolor": "black", "linestyle": ""}
    marks = {name: failed | {"marker": mark} for name, mark in MARKS.items() if name in failures}
    handles = [Line2D([], [], label=name, **style) for name, style in [*styles.items(), *marks.items()]]
    panel.legend(handles=handles, loc="lower left", ncols=2, framealpha=0.9)
    panel.tick_params(labelbottom=False)


def _draw_speeds(panel: Axes, report: Summary, styles: Styles) -> None:
    """Draw the paper's speeds as bars and ours as dots; whiskers are one standard deviation of each."""
    muds, width = list(report["settings"]["mud_length_cm"]), 0.8 / len(styles)
    for i, (gait, style) in enumerate(styles.items()):
        places = np.arange(len(muds)) + (i - (len(styles) - 1) / 2.0) * width
        papers = report["paper"].get(gait, {})
        bars = _speeds([papers.get(mud, UNREACHED) for mud in muds], places)
        panel.bar(bars.index, bars["mean"], 0.92 * width, yerr=bars["sd"],
                  color="0.85", edgecolor="0.6", ecolor="0.5", capsize=3)  # fmt: skip
        ours = [report["table"][gait][mud] for mud in muds]
        dots = _speeds([(cell["mean"], cell["sd"] or 0.0) for cell in ours], places)
        panel.errorbar(dots.index, dots["mean"], dots["sd"], fmt=style["marker"], color=style["color"],
                       capsize=3, **DOT)  # fmt: skip
    best_depths = report.get("best_constant_depth", {})
    for place, best in enumerate(best_depths.values()):
        panel.hlines(best["mean"], place - 0.42, place + 0.42, color=TEXT, linewidth=1.0, linestyle=":")
    panel.set_xticks(range(len(muds)), [mud_label(mud) for mud in muds])
    panel.set_ylim(0.0, max(panel.get_ylim()[1], 9.0))
    panel.set_ylabel("speed (cm/s)")
    panel.set_title("Table I: the paper's (grey bars), ours (dots), ± sd")
    if best_depths:
        dots_of_best = Line2D([], [], color=TEXT, linestyle=":", label="best constant depth")
        panel.legend(handles=[dots_of_best], loc="upper right")


def _speeds(speeds: Sequence[tuple[float | None, float]], places: Any) -> DataFrame:
    """Return mean and standard deviation of the muds that were reached, by place in the picture."""
    return DataFrame(speeds, columns=["mean", "sd"], index=places, dtype=float).dropna()
