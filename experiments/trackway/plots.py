"""The walks as pictures: along the trackway as in the paper's figure 8, and speed over depth and strength."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 - after the choice of a backend without a screen
import numpy as np  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402

from experiments.reports.mud_names import mud_label  # noqa: E402
from experiments.trackway.paper_table import ADAPTIVE  # noqa: E402
from experiments.trackway.walk import EXTRACTION, SLIPPAGE  # noqa: E402

COLOURS = {"3 cm": "tab:green", "5 cm": "tab:orange", ADAPTIVE: "tab:blue"}  # as in the paper
OTHERS = ("tab:red", "tab:purple", "tab:brown")
LINES, DOTS = ("-", "--", "-.", ":"), ("o", "s", "D", "^", "P", "*")  # of the gaits, for print without colours
MUD_SHADES = ("#e9dfd0", "#f6f1e8", "#d8c7ad")
MARKS = {SLIPPAGE: "v", EXTRACTION: "X"}
METHOD_COLOURS = ("white", "tab:red", "tab:cyan", "tab:pink")
BESIDE = 1.03  # of the methods' dots in strength, so that none hides another
TEXT = "#333333"


def plot_trackway(report: dict[str, Any], path: Path) -> None:
    """Step length and depth along the track, and the table beside the paper's."""
    figure, axes = plt.subplot_mosaic(
        [["steps", "speeds"], ["depths", "speeds"]],
        figsize=(12.0, 5.6),
        width_ratios=(1.5, 1.0),
        height_ratios=(1.6, 1.0),
        constrained_layout=True,
    )
    colours = _colours(list(report["table"]))
    _plot_steps(axes["steps"], report, colours)
    _plot_walks(axes["depths"], report, colours, "depth_cm")
    axes["depths"].set_ylabel("depth (cm)")
    axes["depths"].invert_yaxis()
    axes["depths"].set_xlabel("place along the track (cm)")
    _plot_speeds(axes["speeds"], report, colours)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _plot_steps(panel: Axes, report: dict[str, Any], colours: Mapping[str, str]) -> None:
    _plot_walks(panel, report, colours, "step_cm")
    panel.set_ylabel("step length (cm)")
    low, high = panel.get_ylim()
    panel.set_ylim(min(0.0, low), high + 0.1 * (high - low))  # room for the muds' names
    _name_muds(panel, report)
    panel.set_title("One walk of each gait over the trackway", fontsize="medium")
    panel.legend(handles=_legend(colours, report), fontsize="small", loc="lower left", ncols=2, framealpha=0.9)
    panel.tick_params(labelbottom=False)


def _plot_walks(panel: Axes, report: dict[str, Any], colours: Mapping[str, str], figure: str) -> None:
    """The first of each gait."""
    _shade_muds(panel, report)
    for look, rule in zip(_looks(colours), colours, strict=True):
        for walk in report["walks"][rule][:1]:  # none where every trial was left out
            _plot_walk(panel, walk, figure, look)


def _colours(rules: Sequence[str]) -> dict[str, str]:
    others = iter(OTHERS * len(rules))
    return {rule: COLOURS[rule] if rule in COLOURS else next(others) for rule in rules}


def _looks(colours: Mapping[str, str]) -> list[dict[str, Any]]:
    """Of each gait's line and dots, in their order."""
    return [
        {"color": colour, "linestyle": LINES[i % len(LINES)], "marker": DOTS[i % len(DOTS)], "markersize": 4.0}
        for i, colour in enumerate(colours.values())
    ]


def _mud_regions(report: dict[str, Any]) -> list[tuple[str, float, float]]:
    """Name, beginning and end in cm along the track."""
    lengths_cm = report["settings"]["mud_length_cm"]
    ends_cm = list(accumulate(lengths_cm.values()))
    return [(mud, end - length, end) for (mud, length), end in zip(lengths_cm.items(), ends_cm, strict=True)]


def _shade_muds(panel: Axes, report: dict[str, Any]) -> None:
    regions = _mud_regions(report)
    for i, (_, begin_cm, end_cm) in enumerate(regions):
        panel.axvspan(begin_cm, end_cm, color=MUD_SHADES[i % len(MUD_SHADES)], zorder=0)
    panel.set_xlim(0.0, regions[-1][2])


def _name_muds(panel: Axes, report: dict[str, Any]) -> None:
    high = panel.get_xaxis_transform()
    for mud, begin_cm, end_cm in _mud_regions(report):
        panel.text((begin_cm + end_cm) / 2.0, 0.97, mud_label(mud), transform=high, ha="center", va="top", color=TEXT)


def _plot_walk(panel: Axes, strides: Sequence[Mapping[str, Any]], figure: str, look: Mapping[str, Any]) -> None:
    places = [stride["place_cm"] for stride in strides]
    panel.plot(places, [stride[figure] for stride in strides], linewidth=1.4, **look)
    for failure, mark in MARKS.items():
        failed = [stride for stride in strides if stride["failure"] == failure]
        xs, ys = [stride["place_cm"] for stride in failed], [stride[figure] for stride in failed]
        panel.plot(xs, ys, mark, color=look["color"], markeredgecolor="black", markeredgewidth=0.6, markersize=7)


def _legend(colours: Mapping[str, str], report: dict[str, Any]) -> list[Line2D]:
    handles = [Line2D([], [], label=rule, **look) for rule, look in zip(colours, _looks(colours), strict=True)]
    names = {stride["failure"] for trials in report["walks"].values() for trial in trials[:1] for stride in trial}
    failed: dict[str, Any] = {"color": "lightgrey", "markeredgecolor": "black", "linestyle": ""}
    return handles + [
        Line2D([], [], marker=mark, label=name, **failed) for name, mark in MARKS.items() if name in names
    ]


def _plot_speeds(panel: Axes, report: dict[str, Any], colours: Mapping[str, str]) -> None:
    """Bars are the paper's, dots ours; whiskers one standard deviation of each."""
    muds, width = list(report["settings"]["mud_length_cm"]), 0.8 / len(colours)
    for i, (rule, look) in enumerate(zip(colours, _looks(colours), strict=True)):
        places = [mud + (i - (len(colours) - 1) / 2.0) * width for mud in range(len(muds))]
        paper = report["paper"].get(rule) or {}
        _plot_paper(panel, places, [paper.get(mud) for mud in muds], 0.92 * width)
        _plot_ours(panel, places, [report["table"][rule][mud] for mud in muds], look)
    best_depths = report.get("best_constant_depth", {})
    for mud, best in enumerate(best_depths.values()):
        panel.hlines(best["mean"], mud - 0.42, mud + 0.42, color=TEXT, linewidth=1.0, linestyle=":")
    panel.set_xticks(range(len(muds)), [mud_label(mud) for mud in muds])
    panel.set_ylim(0.0, max(panel.get_ylim()[1], 9.0))
    panel.set_ylabel("speed (cm/s)")
    panel.set_title("Table I: the paper's (grey bars), ours (dots), ± sd", fontsize="medium")
    if best_depths:
        dots = Line2D([], [], color=TEXT, linestyle=":", label="best constant depth")
        panel.legend(handles=[dots], fontsize="small", loc="upper right")


def _plot_paper(panel: Axes, places: Sequence[float], cells: Sequence[Mapping[str, Any] | None], width: float) -> None:
    reported = [(place, cell) for place, cell in zip(places, cells, strict=True) if cell]
    if reported:
        panel.bar([place for place, _ in reported], [cell["mean"] for _, cell in reported], width,
                  yerr=[cell["sd"] for _, cell in reported],
                  color="0.85", edgecolor="0.6", ecolor="0.5", capsize=3)  # fmt: skip


def _plot_ours(
    panel: Axes, places: Sequence[float], cells: Sequence[Mapping[str, Any]], look: Mapping[str, Any]
) -> None:
    reached = [(place, cell) for place, cell in zip(places, cells, strict=True) if cell["mean"] is not None]
    panel.errorbar([place for place, _ in reached], [cell["mean"] for _, cell in reached],
                   yerr=[cell["sd"] or 0.0 for _, cell in reached], fmt=look["marker"], color=look["color"],
                   markeredgecolor="black", markeredgewidth=0.6, markersize=7, capsize=3)  # fmt: skip


def plot_sweep(report: dict[str, Any], path: Path) -> None:
    """Above speed over strength and depth with every method's choice, below what share of the best it is."""
    figure, (over, below) = plt.subplots(
        2, 1, figsize=(9.0, 7.2), height_ratios=(2.2, 1.0), sharex=True, constrained_layout=True
    )
    rows = report["strengths"]
    strengths_kpa = np.array([row["strength_pa"] / 1000.0 for row in rows])
    colours = dict(zip(report["settings"]["methods"], METHOD_COLOURS * len(rows), strict=False))
    _plot_map(figure, over, rows, strengths_kpa)
    best = [row["best"]["depth_cm"] for row in rows]
    over.plot(strengths_kpa, best, color="black", linewidth=1.2, linestyle="--", label="best constant depth")
    for i, (method, colour) in enumerate(colours.items()):
        beside = strengths_kpa * BESIDE ** (i - (len(colours) - 1) / 2.0)
        _plot_choice(over, rows, beside, method, colour)
        _plot_fraction(below, rows, beside, method, colour, 7 if i == 0 else -12 * i)
    _name_sweep_axes(over, below, strengths_kpa)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _plot_map(figure: Any, panel: Axes, rows: Sequence[Mapping[str, Any]], strengths_kpa: Any) -> None:
    depths = [each["depth_cm"] for each in rows[0]["constant"]]
    speeds = np.array([[each["mean"] for each in row["constant"]] for row in rows]).T
    mesh = panel.pcolormesh(
        _edges(strengths_kpa, logarithmic=True), _edges(np.array(depths)), speeds, cmap="viridis", vmin=0.0
    )
    figure.colorbar(mesh, ax=panel, label="speed (cm/s)", pad=0.01)
    for name, mark in MARKS.items():
        failed = [
            (row["strength_pa"] / 1000.0, each["depth_cm"])
            for row in rows
            for each in row["constant"]
            if _fraction(each["failures"].get(name, 0), each["strides"]) > 0.1
        ]
        panel.plot([x for x, _ in failed], [y for _, y in failed], mark, color="#ffffff90", markeredgecolor="none",
                   markersize=5, label=f"{name} in more than a tenth of the strides")  # fmt: skip


def _edges(centres: Any, logarithmic: bool = False) -> Any:
    """Of cells around the centres."""
    reported = np.log(centres) if logarithmic else centres
    if len(reported) == 1:
        edges = np.array([reported[0] - 0.1, reported[0] + 0.1])
    else:
        between = (reported[1:] + reported[:-1]) / 2.0
        edges = np.concatenate(
            [[reported[0] - (between[0] - reported[0])], between, [reported[-1] + (reported[-1] - between[-1])]]
        )
    return np.exp(edges) if logarithmic else edges


def _fraction(count: int, of: int) -> float:
    return count / of if of else 0.0


def _plot_choice(panel: Axes, rows: Sequence[Mapping[str, Any]], strengths_kpa: Any, method: str, colour: str) -> None:
    reported = [(strength, row["methods"][method]) for strength, row in zip(strengths_kpa, rows, strict=True)]
    reported = [(strength, settled) for strength, settled in reported if settled["depth_cm"] is not None]
    depths = np.array([settled["depth_cm"] for _, settled in reported])
    ranges = np.array([settled["depth_range_cm"] for _, settled in reported]).reshape(-1, 2)
    look: dict[str, Any] = {"fmt": "o", "markeredgecolor": "black", "markersize": 7, "capsize": 3, "linewidth": 1.2}
    places = [strength for strength, _ in reported]
    panel.errorbar(places, depths, yerr=abs(ranges.T - depths), color=colour, label=f"method {method}", **look)


def _plot_fraction(
    panel: Axes, rows: Sequence[Mapping[str, Any]], strengths_kpa: Any, method: str, colour: str, points: int
) -> None:
    """Failures are written that many points above the dots."""
    settled = [row["methods"][method] for row in rows]
    fractions = [100.0 * (each["share_of_best"] or 0.0) for each in settled]
    line = TEXT if colour == "white" else colour
    panel.plot(strengths_kpa, fractions, "-o", color=line, markerfacecolor=colour, markersize=6, label=method)
    for strength, fraction, each in zip(strengths_kpa, fractions, settled, strict=True):
        failed = sum(each["failures"].values())
        if failed:
            look: dict[str, Any] = {"textcoords": "offset points", "xytext": (0, points), "ha": "center"}
            panel.annotate(f"{failed}/{each['strides']}", (strength, fraction), color=line, fontsize="x-small", **look)


def _name_sweep_axes(over: Axes, below: Axes, strengths_kpa: Any) -> None:
    over.set_ylabel("insertion depth (cm)")
    over.invert_yaxis()
    over.set_title("Speed of constant depths, and where the adaptation settles", fontsize="medium")
    over.legend(fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=3, facecolor="#8fa3ad")
    below.axhline(100.0, color="grey", linewidth=0.8, linestyle=":")
    below.set_ylim(0.0, max(130.0, below.get_ylim()[1]))
    below.set_ylabel("% of the best constant depth")
    below.set_xlabel("undrained strength of the mud (kPa); numbers at the dots: failed strides after the second")
    below.set_xscale("log")
    below.set_xticks(strengths_kpa, [f"{strength:g}" for strength in strengths_kpa])
    below.minorticks_off()
    below.legend(fontsize="small", loc="lower left")
