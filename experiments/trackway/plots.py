"""The walks as a picture: along the trackway as in the paper's figure 8, and Table I as bars and dots."""

from collections.abc import Mapping, Sequence
from itertools import accumulate, cycle
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from experiments.reports.mud_names import mud_label
from experiments.trackway.table_one import ADAPTIVE, Speed, Summary
from experiments.trackway.walk import EXTRACTION, SLIPPAGE

COLOURS = {"3 cm": "tab:green", "5 cm": "tab:orange", ADAPTIVE: "tab:blue"}  # as in the paper
OTHERS = ("tab:red", "tab:purple", "tab:brown")
LINES, DOTS = ("-", "--", "-.", ":"), ("o", "s", "D", "^", "P", "*")  # the gaits, for print without colours
MUD_SHADES = ("#e9dfd0", "#f6f1e8", "#d8c7ad")
MARKS = {SLIPPAGE: "v", EXTRACTION: "X"}
TEXT = "#333333"


def draw_trackway(report: Summary) -> Figure:
    """Draw step length and depth along the track, and the speeds next to the paper's."""
    figure = Figure(figsize=(12.0, 5.6))
    axes = figure.subplot_mosaic(
        [["steps", "speeds"], ["depths", "speeds"]], width_ratios=(1.5, 1.0), height_ratios=(1.6, 1.0)
    )
    colours = _colours(list(report["table"]))
    _plot_steps(axes["steps"], report, colours)
    _plot_walks(axes["depths"], report, colours, "depth_cm")
    axes["depths"].set_ylabel("depth (cm)")
    axes["depths"].invert_yaxis()
    axes["depths"].set_xlabel("position along the track (cm)")
    _plot_speeds(axes["speeds"], report, colours)
    return figure


def _plot_steps(panel: Axes, report: Summary, colours: Mapping[str, str]) -> None:
    _plot_walks(panel, report, colours, "step_cm")
    panel.set_ylabel("step length (cm)")
    low, high = panel.get_ylim()
    panel.set_ylim(min(0.0, low), high + 0.1 * (high - low))  # room for the muds' names
    across = panel.get_xaxis_transform()
    for mud, begin_cm, end_cm in _mud_regions(report):
        panel.text((begin_cm + end_cm) / 2.0, 0.97, mud_label(mud), transform=across, ha="center", va="top", color=TEXT)
    panel.set_title("One walk of each gait over the trackway")
    panel.legend(handles=_legend(colours, report), loc="lower left", ncols=2, framealpha=0.9)
    panel.tick_params(labelbottom=False)


def _plot_walks(panel: Axes, report: Summary, colours: Mapping[str, str], key: str) -> None:
    """Draw the first walk of each gait on its muds."""
    for shade, (_, begin_cm, end_cm) in zip(cycle(MUD_SHADES), _mud_regions(report), strict=False):
        panel.axvspan(begin_cm, end_cm, color=shade, zorder=0)
    panel.set_xlim(0.0, end_cm)
    for style, rule in zip(_styles(colours), colours, strict=True):
        for walk in report["walks"][rule][:1]:  # none where every trial was left out
            _plot_walk(panel, walk, key, style)


def _colours(rules: Sequence[str]) -> dict[str, str]:
    others = iter(OTHERS * len(rules))
    return {rule: COLOURS[rule] if rule in COLOURS else next(others) for rule in rules}


def _styles(colours: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the style of each gait's line and dots."""
    return [
        {"color": colour, "linestyle": LINES[i % len(LINES)], "marker": DOTS[i % len(DOTS)], "markersize": 4.0}
        for i, colour in enumerate(colours.values())
    ]


def _mud_regions(report: Summary) -> list[tuple[str, float, float]]:
    """Return name, beginning and end of each mud in cm along the track."""
    lengths_cm = report["settings"]["mud_length_cm"]
    ends_cm = list(accumulate(lengths_cm.values()))
    return [(mud, end - length, end) for (mud, length), end in zip(lengths_cm.items(), ends_cm, strict=True)]


def _plot_walk(panel: Axes, strides: Sequence[Summary], key: str, style: Mapping[str, Any]) -> None:
    positions_cm = [stride["position_cm"] for stride in strides]
    panel.plot(positions_cm, [stride[key] for stride in strides], linewidth=1.4, **style)
    for failure, mark in MARKS.items():
        failed = [stride for stride in strides if stride["failure"] == failure]
        points = [stride["position_cm"] for stride in failed], [stride[key] for stride in failed]
        panel.plot(*points, mark, color=style["color"], markeredgecolor="black", markeredgewidth=0.6, markersize=7)


def _legend(colours: Mapping[str, str], report: Summary) -> list[Line2D]:
    handles = [Line2D([], [], label=rule, **style) for rule, style in zip(colours, _styles(colours), strict=True)]
    names = {stride["failure"] for trials in report["walks"].values() for trial in trials[:1] for stride in trial}
    failed: dict[str, Any] = {"color": "lightgrey", "markeredgecolor": "black", "linestyle": ""}
    return handles + [
        Line2D([], [], marker=mark, label=name, **failed) for name, mark in MARKS.items() if name in names
    ]


def _plot_speeds(panel: Axes, report: Summary, colours: Mapping[str, str]) -> None:
    """Draw the paper's speeds as bars and ours as dots; whiskers are one standard deviation of each."""
    muds, width = list(report["settings"]["mud_length_cm"]), 0.8 / len(colours)
    for i, (rule, style) in enumerate(zip(colours, _styles(colours), strict=True)):
        xs = [mud + (i - (len(colours) - 1) / 2.0) * width for mud in range(len(muds))]
        paper = report["paper"].get(rule) or {}
        _plot_paper(panel, xs, [paper.get(mud) for mud in muds], 0.92 * width)
        _plot_ours(panel, xs, [report["table"][rule][mud] for mud in muds], style)
    best_depths = report.get("best_constant_depth", {})
    for mud, best in enumerate(best_depths.values()):
        panel.hlines(best["mean"], mud - 0.42, mud + 0.42, color=TEXT, linewidth=1.0, linestyle=":")
    panel.set_xticks(range(len(muds)), [mud_label(mud) for mud in muds])
    panel.set_ylim(0.0, max(panel.get_ylim()[1], 9.0))
    panel.set_ylabel("speed (cm/s)")
    panel.set_title("Table I: the paper's (grey bars), ours (dots), ± sd")
    if best_depths:
        dots = Line2D([], [], color=TEXT, linestyle=":", label="best constant depth")
        panel.legend(handles=[dots], loc="upper right")


def _plot_paper(panel: Axes, xs: Sequence[float], speeds: Sequence[Speed | None], width: float) -> None:
    known = [(x, speed) for x, speed in zip(xs, speeds, strict=True) if speed]
    if known:
        panel.bar([x for x, _ in known], [speed.mean for _, speed in known], width,
                  yerr=[speed.sd for _, speed in known],
                  color="0.85", edgecolor="0.6", ecolor="0.5", capsize=3)  # fmt: skip


def _plot_ours(panel: Axes, xs: Sequence[float], cells: Sequence[Summary], style: Mapping[str, Any]) -> None:
    reached = [
        (x, cell["mean"], cell["sd"] or 0.0) for x, cell in zip(xs, cells, strict=True) if cell["mean"] is not None
    ]
    panel.errorbar([x for x, *_ in reached], [mean for _, mean, _ in reached], [sd for *_, sd in reached],
                   fmt=style["marker"], color=style["color"],
                   markeredgecolor="black", markeredgewidth=0.6, markersize=7, capsize=3)  # fmt: skip
