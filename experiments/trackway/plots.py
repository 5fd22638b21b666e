"""The walks as a picture: along the trackway as in the paper's figure 8, and Table I as bars and dots."""

from collections.abc import Mapping, Sequence
from itertools import accumulate, cycle
from math import nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pandas import DataFrame

from experiments.reports.mud_names import mud_label
from experiments.reports.mud_styles import line_of, looks_of
from experiments.reports.style import BODY, FAINT, INK, MUD_SHADES, WIDTH_IN
from experiments.trackway.table_one import Summary
from experiments.trackway.walk import EXTRACTION, SLIPPAGE

MARKS = {SLIPPAGE: "v", EXTRACTION: "X"}
DOT: dict[str, Any] = {"markeredgecolor": INK, "markeredgewidth": 0.6, "markersize": 7}
UNREACHED = (nan, nan)
Looks = Mapping[str, dict[str, Any]]  # of each gait's line and dots


def draw_trackway(report: Summary) -> Figure:
    """Draw step length and depth along the track, and the speeds next to the paper's."""
    figure = Figure(figsize=(WIDTH_IN, 5.6))
    axes = figure.subplot_mosaic(
        [["steps", "speeds"], ["depths", "speeds"]], width_ratios=(1.5, 1.0), height_ratios=(1.6, 1.0)
    )
    looks, steps, depths = looks_of(list(report["table"])), axes["steps"], axes["depths"]
    _draw_walks(steps, report, looks, "step_cm")
    for name, mark in MARKS.items():
        steps.plot([], [], mark, color=BODY, label=name, **DOT)
    steps.margins(y=0.1)  # room for the muds' names
    steps.set(ylabel="step length (cm)", title="One walk of each gait over the trackway")
    figure.legend(*steps.get_legend_handles_labels(), loc="outside upper center", ncols=len(looks) + len(MARKS))
    steps.tick_params(labelbottom=False)
    _draw_walks(depths, report, looks, "depth_cm")
    depths.margins(y=0.2)
    depths.invert_yaxis()
    depths.set(xlabel="position along the track (cm)", ylabel="depth (cm)")
    _draw_speeds(axes["speeds"], report, looks)
    return figure


def _draw_walks(panel: Axes, report: Summary, looks: Looks, key: str) -> None:
    """Draw the first walk of each gait on its muds."""
    _draw_muds(panel, report["settings"]["mud_length_cm"])
    for gait, look in looks.items():
        for strides in report["walks"][gait][:1]:  # none where every trial was left out
            walk = DataFrame(strides, columns=["position_cm", key, "failure"])
            panel.plot("position_cm", key, data=walk, label=gait, marker=look["marker"], markersize=4, **line_of(look))
            for failure, mark in MARKS.items():
                failed = walk[walk["failure"] == failure]
                panel.plot(failed["position_cm"], failed[key], mark, color=look["color"], **DOT)


def _draw_muds(panel: Axes, lengths_cm: Mapping[str, float]) -> None:
    ends_cm = accumulate(lengths_cm.values())
    for shade, (mud, length_cm), end_cm in zip(cycle(MUD_SHADES), lengths_cm.items(), ends_cm, strict=False):
        panel.axvspan(end_cm - length_cm, end_cm, color=shade, zorder=0)
        middle, across = (end_cm - length_cm / 2.0, 0.97), panel.get_xaxis_transform()
        panel.text(*middle, mud_label(mud), transform=across, ha="center", va="top", color=INK)
    panel.set_xlim(0.0, end_cm)


def _draw_speeds(panel: Axes, report: Summary, looks: Looks) -> None:
    """Draw the paper's speeds as bars and ours as dots; whiskers are one standard deviation of each."""
    muds, width = list(report["settings"]["mud_length_cm"]), 0.8 / len(looks)
    for i, (gait, look) in enumerate(looks.items()):
        places = np.arange(len(muds)) + (i - (len(looks) - 1) / 2.0) * width
        papers, ours = report["paper"].get(gait, {}), [report["table"][gait][mud] for mud in muds]
        means, sds = np.array([papers.get(mud, UNREACHED) for mud in muds]).T
        panel.bar(places, means, 0.92 * width, yerr=sds, color=BODY, edgecolor=FAINT, ecolor=FAINT, capsize=3)
        means, sds = np.array([(cell["mean"], cell["sd"] or 0.0) for cell in ours], dtype=float).T
        panel.errorbar(places, means, sds, fmt=look["marker"], color=look["color"], capsize=3, **DOT)
    if best := [each["mean"] for each in report.get("best_constant_depth", {}).values()]:
        _draw_best(panel, best)
    panel.set_xticks(range(len(muds)), [mud_label(mud) for mud in muds])
    panel.set_ylim(0.0, max(panel.get_ylim()[1], 9.0))
    panel.set(ylabel="speed (cm/s)", title="Table I: the paper's (grey bars), ours (dots), ± sd")


def _draw_best(panel: Axes, speeds: Sequence[float]) -> None:
    middles = np.arange(len(speeds))
    look: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": ":"}
    panel.hlines(speeds, middles - 0.42, middles + 0.42, label="best constant depth", **look)
    panel.legend(loc="upper right")
