"""Speed against depth in mud from soup to firm clay, and the depth at which each method of adaptation settles.

In each mud the robot walks at constant depths, and then by each method, long enough for it to settle. A method is
evaluated from its third stride on: by its speed as a fraction of the best constant depth's, and by its failed strides.
"""

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from statistics import fmean, median
from typing import Annotated, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from numpy.typing import NDArray
from pandas import DataFrame

from control.parameters.adaptation_parameters import Method
from experiments.reports.style import FAINT, INK, WIDTH_IN
from experiments.reports.text_tables import number
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trackway.plots import MARKS
from experiments.trackway.simulated_walk import (
    CONSTANT_STRIDES,
    LEARNING,
    METHODS,
    STARTING,
    arm_m,
    best_depth,
    constant_rows,
    mean_speeds_cm_s,
    speed_cm_s,
    walk_in_mud,
    walking_world,
    walks_in,
)
from experiments.trackway.table_one import count_failures
from experiments.trackway.walk import Walk
from simulation.mud.disturbances import TRACKWAY

SCHEMA = 2
STRENGTHS_PA = (300.0, 400.0, 500.0, 680.0, 1000.0, 1500.0, 2000.0, 2800.0, 3250.0, 4000.0, 5000.0, 6000.0)
METHOD_STRIDES = 12
METHOD_COLOURS = ("white", "C1", "C5", "C4")  # seen on the map
FAILED_PT = (7, -14, 16, -23)  # from a dot to its number of failed strides, which no other method writes over
OFFSET = 1.03  # between the methods' dots, as a factor of strength, so that none hides another
MAP = (
    "Above: the colour is the speed at a constant depth. A dot is the median of the depths that a method chose after "
    "its second stride, its bar their range. Below: its speed as a percentage of the best constant depth's."
)
Summary = dict[str, Any]


def study(
    trials: Trials,
    *,
    strength: Annotated[
        tuple[float, ...], Option("undrained strength of a mud", low=50, high=50000, unit="Pa", metavar="PA")
    ] = STRENGTHS_PA,
    method: Annotated[tuple[Method, ...], Option("of adaptation (default: all)")] = METHODS,
    seeds: Annotated[int, Option("walks of each point", low=1, high=1000)] = 2,
) -> Result:
    """Speed against depth in muds of any strength."""
    strengths_pa, methods = sorted(set(strength)), list(dict.fromkeys(method))
    adaptive = [
        {"strength_pa": strength_pa, "method": each, "count": METHOD_STRIDES, "seed": seed}
        for strength_pa in strengths_pa
        for each in methods
        for seed in range(1, seeds + 1)
    ]
    trials.require_same(**walking_world())
    walked = trials.run(walk_in_mud, [*adaptive, *constant_rows(strengths_pa, seeds)])  # the longest first
    muds = [{"strength_pa": strength_pa} | sweep_of(walks) for strength_pa, walks in walked.groupby("strength_pa")]
    settings = {
        "methods": methods,
        "seeds": seeds,
        "constant_strides": CONSTANT_STRIDES,
        "method_strides": METHOD_STRIDES,
        "disturbances": asdict(TRACKWAY),
    }
    title = "Speed at the best constant depth, and where each method settles (after its second stride)"
    table = Table(
        "sweep", title, {}, DataFrame([{"strength": f"{mud['strength_pa']:g} Pa"} | sweep_row(mud) for mud in muds])
    )
    return Result([table], [Figure("sweep", MAP, partial(draw, muds))], {"strengths": muds, "settings": settings})


def sweep_of(walks: DataFrame) -> Summary:
    """Evaluate the walks on one ground: at constant depths, and by each method."""
    constant = walks[walks["method"].isna()]
    speeds = mean_speeds_cm_s(constant)
    best = best_depth(speeds)
    return {
        "constant": [
            {"depth_cm": round(100.0 * depth_m, 4), "mean": round(speeds[depth_m], 3)} | _count(walks_in(own), STARTING)
            for depth_m, own in constant.groupby("depth_m")
        ],
        "best": best,
        "methods": {
            method: _settled(walks_in(own), best["mean"]) for method, own in walks.groupby("method", sort=False)
        },
    }


def _settled(walks: Sequence[Walk], best_cm_s: float) -> Summary:
    """Evaluate a method after its second stride. The depth is None where no walk had a third one."""
    depths = [stride.depth_m for walk in walks for stride in walk.strides[LEARNING:]]
    mean = fmean(speed_cm_s(walk, LEARNING) for walk in walks)
    return _count(walks, LEARNING) | {
        "depth_cm": round(100.0 * median(depths), 3) if depths else None,
        "depth_range_cm": [round(100.0 * min(depths), 3), round(100.0 * max(depths), 3)] if depths else None,
        "mean": round(mean, 3),
        "fraction_of_best": round(mean / best_cm_s, 3) if best_cm_s > 0.0 else None,
    }


def _count(walks: Sequence[Walk], skipped: int) -> Summary:
    """Return how many strides count, how many of them failed, and the faults that ended walks."""
    counted = [walk.strides[skipped:] for walk in walks]
    return {
        "strides": sum(len(strides) for strides in counted),
        "failures": (failures := count_failures(counted, arm_m())),
        "failed": sum(failures.values()),
        "faults": sorted({walk.fault for walk in walks if walk.fault}),
    }


def sweep_row(mud: Summary) -> dict[str, str]:
    """Return the best constant depth and each method as a row of a table."""
    cells = {f"{name}: depth, speed (cm/s), % of best, failed": _cell(each) for name, each in mud["methods"].items()}
    best = mud["best"]
    return {"best depth": f"{best['depth_cm']:g} cm", "speed (cm/s)": f"{best['mean']:.2f}"} | cells


def _cell(settled: Summary) -> str:
    failed, fault = settled["failed"], ", fault" if settled["faults"] else ""
    fraction = settled["fraction_of_best"]
    percent = "-" if fraction is None else f"{100.0 * fraction:3.0f} %"
    return (
        f"{number(settled['depth_cm'], 2)} cm  {settled['mean']:z5.2f}  {percent}  {failed}/{settled['strides']}{fault}"
    )


def draw(muds: Sequence[Summary]) -> Drawing:
    """Draw speed over strength and depth with each method's choice, and below it each method's fraction of the best."""
    figure = Drawing(figsize=(WIDTH_IN, 7.6))
    over, below = figure.subplots(2, 1, height_ratios=(2.2, 1.0), sharex=True)
    strengths_kpa = np.array([mud["strength_pa"] / 1000.0 for mud in muds])
    _draw_map(figure, over, muds, strengths_kpa)
    best = [mud["best"]["depth_cm"] for mud in muds]
    over.plot(strengths_kpa, best, color=INK, linewidth=1.2, linestyle="--", label="best constant depth")
    methods = list(muds[0]["methods"])
    for i, method in enumerate(methods):
        colour = METHOD_COLOURS[i % len(METHOD_COLOURS)]
        shifted_kpa = strengths_kpa * OFFSET ** (i - (len(methods) - 1) / 2.0)
        settled = DataFrame([mud["methods"][method] for mud in muds]).assign(kpa=shifted_kpa)
        _draw_choice(over, settled, method, colour)
        _draw_fraction(below, settled, method, colour, FAILED_PT[i % len(FAILED_PT)])
    over.invert_yaxis()
    over.set(ylabel="insertion depth (cm)", title="Speed of constant depths, and where the adaptation settles")
    over.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=3, facecolor=FAINT, labelcolor="white")
    below.axhline(100.0, color=FAINT, linewidth=0.8, linestyle=":")
    below.set(
        xscale="log",
        xlabel="undrained strength of the mud (kPa); numbers at the dots: failed strides after the second",
        ylabel="% of the best constant",
        ylim=(0.0, max(130.0, below.get_ylim()[1])),
    )
    below.set_xticks(strengths_kpa, [f"{strength:g}" for strength in strengths_kpa])
    below.minorticks_off()
    below.legend(loc="lower left")
    return figure


def _draw_map(figure: Drawing, panel: Axes, muds: Sequence[Summary], strengths_kpa: NDArray[np.float64]) -> None:
    constant = DataFrame([{"kpa": mud["strength_pa"] / 1000.0} | each for mud in muds for each in mud["constant"]])
    speeds = constant.pivot(index="depth_cm", columns="kpa", values="mean")
    edges = np.exp(_edges(np.log(strengths_kpa))), _edges(speeds.index.to_numpy())
    mesh = panel.pcolormesh(*edges, speeds, cmap="viridis", vmin=0.0)
    figure.colorbar(mesh, ax=panel, label="speed (cm/s)", pad=0.01)
    for name, mark in MARKS.items():
        failed = constant[[failures.get(name, 0) for failures in constant["failures"]] > 0.1 * constant["strides"]]
        panel.plot(failed["kpa"], failed["depth_cm"], mark, color="#ffffff90", markeredgecolor="none", markersize=5,
                   label=f"{name} in more than a tenth of the strides")  # fmt: skip


def _edges(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of the cells around the centres."""
    halves = np.diff(centres) / 2.0
    first, last = (halves[0], halves[-1]) if len(halves) else (0.1, 0.1)
    return np.concatenate([centres[:1] - first, centres[:-1] + halves, centres[-1:] + last])


def _draw_choice(panel: Axes, settled: DataFrame, method: str, colour: str) -> None:
    """Draw the depths at which the method settled, with their range."""
    known = settled.dropna(subset="depth_cm")
    depths_cm = known["depth_cm"].to_numpy(float)
    errors_cm = abs(np.array(known["depth_range_cm"].tolist()).reshape(-1, 2).T - depths_cm)
    panel.errorbar(known["kpa"], depths_cm, errors_cm, color=colour, label=f"method {method}",
                   fmt="o", markeredgecolor=INK, markersize=7, capsize=3, linewidth=1.2)  # fmt: skip


def _draw_fraction(panel: Axes, settled: DataFrame, method: str, colour: str, points: int) -> None:
    """Draw the fractions of the best speed; failures are written `points` above the dots."""
    settled = settled.assign(percent=100.0 * settled["fraction_of_best"].astype(float).fillna(0.0))
    line = INK if colour == "white" else colour
    panel.plot("kpa", "percent", "-o", data=settled, color=line, markerfacecolor=colour, markersize=6, label=method)
    for each in settled.itertuples():
        if each.failed:
            panel.annotate(f"{each.failed}/{each.strides}", (each.kpa, each.percent), color=line, fontsize="x-small",
                           textcoords="offset points", xytext=(0, points), ha="center")  # fmt: skip
