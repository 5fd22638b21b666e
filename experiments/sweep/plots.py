"""The depth sweep as a picture: speed over depth and strength, and where each method settles."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.sweep.sweep import SettledMethod, SweepReport, SweptMud
from experiments.trackway.plots import MARKS, TEXT

Floats = NDArray[np.float64]
METHOD_COLOURS = ("white", "tab:red", "tab:cyan", "tab:pink")
OFFSET = 1.03  # between the methods' dots, as a factor of strength, so that none hides another


def plot_sweep(report: SweepReport, path: Path) -> None:
    """Draw speed over strength and depth with each method's choice, and below it each method's fraction of the best."""
    figure = Figure(figsize=(9.0, 7.2), layout="constrained")
    over, below = figure.subplots(2, 1, height_ratios=(2.2, 1.0), sharex=True)
    muds = report.strengths
    strengths_kpa = np.array([mud.strength_pa / 1000.0 for mud in muds])
    colours = dict(zip(report.settings.methods, METHOD_COLOURS * len(muds), strict=False))
    _plot_map(figure, over, muds, strengths_kpa)
    best = [mud.best.depth_cm for mud in muds]
    over.plot(strengths_kpa, best, color="black", linewidth=1.2, linestyle="--", label="best constant depth")
    for i, (method, colour) in enumerate(colours.items()):
        shifted_kpa = strengths_kpa * OFFSET ** (i - (len(colours) - 1) / 2.0)
        settled = [mud.methods[method] for mud in muds]
        _plot_choice(over, settled, shifted_kpa, method, colour)
        _plot_fraction(below, settled, shifted_kpa, method, colour, 7 if i == 0 else -12 * i)
    _name_sweep_axes(over, below, strengths_kpa)
    figure.savefig(path, dpi=110)


def _plot_map(figure: Any, panel: Axes, muds: Sequence[SweptMud], strengths_kpa: Floats) -> None:
    depths_cm = np.array([each.depth_cm for each in muds[0].constant])
    speeds = np.array([[each.mean for each in mud.constant] for mud in muds]).T
    edges = _edges(strengths_kpa, logarithmic=True), _edges(depths_cm)
    mesh = panel.pcolormesh(*edges, speeds, cmap="viridis", vmin=0.0)
    figure.colorbar(mesh, ax=panel, label="speed (cm/s)", pad=0.01)
    for name, mark in MARKS.items():
        failed = [
            (mud.strength_pa / 1000.0, each.depth_cm)
            for mud in muds
            for each in mud.constant
            if each.failures.get(name, 0) > 0.1 * each.strides
        ]
        panel.plot([x for x, _ in failed], [y for _, y in failed], mark, color="#ffffff90", markeredgecolor="none",
                   markersize=5, label=f"{name} in more than a tenth of the strides")  # fmt: skip


def _edges(centres: Floats, logarithmic: bool = False) -> Floats:
    """Return the edges of the cells around the centres."""
    middles = np.log(centres) if logarithmic else centres
    halves = np.diff(middles) / 2.0 if len(middles) > 1 else np.array([0.1])
    edges: Floats = np.concatenate(
        [middles[:1] - halves[0], middles[:-1] + halves[: len(middles) - 1], middles[-1:] + halves[-1]]
    )
    return np.exp(edges) if logarithmic else edges


def _plot_choice(
    panel: Axes, settled: Sequence[SettledMethod], strengths_kpa: Floats, method: str, colour: str
) -> None:
    """Draw the depths at which the method settled, with their range."""
    known = [(x, each.depth_cm, each.depth_range_cm) for x, each in zip(strengths_kpa, settled, strict=True)]
    known = [each for each in known if each[1] is not None]
    depths_cm = np.array([depth_cm for _, depth_cm, _ in known])
    errors_cm = abs(np.array([depth_range for *_, depth_range in known]).reshape(-1, 2).T - depths_cm)
    style: dict[str, Any] = {"fmt": "o", "markeredgecolor": "black", "markersize": 7, "capsize": 3, "linewidth": 1.2}
    panel.errorbar([x for x, *_ in known], depths_cm, errors_cm, color=colour, label=f"method {method}", **style)


def _plot_fraction(
    panel: Axes, settled: Sequence[SettledMethod], strengths_kpa: Floats, method: str, colour: str, points: int
) -> None:
    """Draw the fractions of the best speed; failures are written `points` above the dots."""
    percent = [100.0 * (each.fraction_of_best or 0.0) for each in settled]
    line = TEXT if colour == "white" else colour
    panel.plot(strengths_kpa, percent, "-o", color=line, markerfacecolor=colour, markersize=6, label=method)
    for strength, height, each in zip(strengths_kpa, percent, settled, strict=True):
        if failed := sum(each.failures.values()):
            style: dict[str, Any] = {"textcoords": "offset points", "xytext": (0, points), "ha": "center"}
            panel.annotate(f"{failed}/{each.strides}", (strength, height), color=line, fontsize="x-small", **style)


def _name_sweep_axes(over: Axes, below: Axes, strengths_kpa: Floats) -> None:
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
