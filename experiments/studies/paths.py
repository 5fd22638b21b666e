"""The coefficients from paths that are no crutching gait, and how well they predict the next stride.

Each gait that ships walks through muds of known strength. The truth of an estimate is a plate on a virtual load cell in
the same mud, at the depth and the speed that the estimate names (experiments/trials/load_cell_truth.py), so no gait is
the reference of another one. The mud is as fresh in every stride. The next stride is predicted by what the robot
remembers before it, at the depth that it reaches: its force is the coefficient times a geometry that is known.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import log
from typing import Annotated, Any

import numpy as np
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from control.controller import WalkOrder
from control.geometry import FlipperGeometry
from control.modes import Mode
from control.records import COEFFICIENTS, UNKNOWN, Estimate, StrideEstimate
from estimation.knowledge import MudKnowledge
from experiments.reports.error_table import NORMAL_95
from experiments.robot.lockstep_robot import simulated_configuration
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trials.load_cell_truth import REVERSAL_FRACTION, true_coefficients
from firmware_host.configuration.gait_file import gait_document, read_gait
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB, NONE
from simulation.mud.track import Track

GAITS = ("walking", "measuring", "ellipse", "alternating", "backward")
LONGEST_STRIDE_S = 12.0


def study(
    trials: Trials,
    *,
    gait: Annotated[tuple[str, ...], Option("name of a gait that ships, or a file", metavar="GAIT")] = GAITS,
    strength: Annotated[tuple[float, ...], Option("of a mud", low=100, high=5e4, unit="Pa")] = (800.0, 1400.0, 3600.0),
    depth: Annotated[float, Option("of insertion", low=1, high=5, unit="cm")] = 3.0,
    strides: Annotated[int, Option("of a walk", low=3, high=200)] = 8,
    seeds: Annotated[int, Option("walks in each mud", low=1, high=100)] = 3,
) -> Result:
    """The coefficients of a mud from paths other than the crutching gait."""
    for name in gait:
        read_gait(gait_document(name))  # refused before anything runs
    walked = {"depth_m": depth / 100.0, "strides": strides}
    rows = [
        {"gait": name, "strength_pa": each, "seed": seed, **walked}
        for name in gait
        for each in strength
        for seed in range(1, seeds + 1)
    ]
    walks = trials.run(walk, rows)
    found = DataFrame([row for each in walks["estimates"] for row in each])
    speeds = walks.groupby(["gait", "strength_pa"], sort=False)[["speed_cm_s", "stuck"]].mean().reset_index()
    errors = DataFrame(
        _summary(keys, rows) for keys, rows in found.groupby(["gait", "strength_pa", "coefficient"], sort=False)
    )
    pooled = DataFrame(_summary(keys, rows) for keys, rows in found.groupby(["gait", "coefficient"], sort=False))
    units = {"strength_pa": "Pa", "median_percent": "%", "prediction_percent": "%", "inside_percent": "%"}
    return Result(
        tables=[
            Table("speeds", "Advance by gait", {"strength_pa": "Pa", "speed_cm_s": "cm/s"}, speeds),
            Table("errors", "Errors by gait and mud", units, errors),
            Table("pooled", "Errors by gait, all muds", units, pooled),
        ],
        figures=[Figure("paths", "Estimate over truth by gait; the band is 10 %.", lambda: draw(found))],
    )


def walk(gait: str, strength_pa: float, seed: int, depth_m: float, strides: int) -> dict[str, Any]:
    """Return the speed of a walk, and its estimates with their truths and predictions."""
    configuration = simulated_configuration()
    clay = Clay(f"{strength_pa:g} Pa", strength_pa)
    noisy = replace(NONE, current_noise_a=LAB.current_noise_a)
    robot = Lockstep(configuration, Track([(1000.0, clay)]), seed=seed, disturbances=noisy)
    robot.arm()
    begun_s = robot.now_s
    robot.walk(WalkOrder(depth_m, adaptive=False, strides=strides, gait=read_gait(gait_document(gait))))
    robot.run_until(lambda: robot.loop.mode is not Mode.WALKING, LONGEST_STRIDE_S * strides)
    closed = [each.estimate for each in robot.loop.learning.strides]
    speed_cm_s = 100.0 * robot.robot.plant.body_m / (robot.now_s - begun_s)
    estimates = list(_compared(closed, clay, configuration.geometry, gait=gait, strength_pa=strength_pa))
    return {"speed_cm_s": speed_cm_s, "stuck": sum(not each.released for each in closed), "estimates": estimates}


def _compared(
    closed: Sequence[StrideEstimate], clay: Clay, geometry: FlipperGeometry, **keys: Any
) -> Iterator[dict[str, Any]]:
    """Yield a row for each coefficient of each stride."""
    knowledge = MudKnowledge()
    for stride in closed:
        remembered = knowledge.mud_estimate.of(stride.flipper)
        truths = true_coefficients(_truth_of(stride, clay), geometry, 0.0, 0.0, upright=False)
        for name in COEFFICIENTS:
            estimate, before = getattr(stride, name), getattr(remembered, name)
            row = keys | {"coefficient": name, "bound": estimate.at_least}
            is_value = estimate.valid and not estimate.at_least and name in truths
            row["ratio"] = estimate.value / truths[name] if is_value else UNKNOWN
            row["normal"] = (estimate.value - truths[name]) / estimate.std_error if is_value else UNKNOWN
            predicts = is_value and before is not None and not before.at_least
            row["predicted"] = log(before.at(estimate.depth_m)[0] / estimate.value) if predicts else UNKNOWN
            yield row
        knowledge.update([stride])


def _truth_of(stride: StrideEstimate, clay: Clay) -> StrideTruth:
    """Return the strokes that the estimates name, for a load cell to repeat."""

    def stroke(estimate: Estimate, part: float = 1.0) -> StrokeTruth:
        depth_m = estimate.depth_m / part
        return StrokeTruth(0.0, 0.0, depth_m, estimate.speed_m_s, estimate.depth_m, depth_m)

    return StrideTruth(
        flipper=stride.flipper,
        index=stride.index,
        ground=clay,
        surface_m=0.0,
        insertion=stroke(stride.k_p),
        stance=stroke(stride.k_s),
        extraction=stroke(stride.k_e, 1.0 - REVERSAL_FRACTION),  # which names the depth where its fit begins
    )


def _summary(keys: Any, rows: DataFrame) -> dict[str, Any]:
    """Return what a table shows of the rows of one gait and coefficient."""
    names = ("gait", "strength_pa", "coefficient") if len(keys) == 3 else ("gait", "coefficient")
    values = rows["ratio"].dropna()
    predicted = rows["predicted"].dropna()
    return dict(zip(names, keys, strict=True)) | {
        "values": len(values),
        "bounds": int(rows["bound"].sum()),
        "median_percent": 100.0 * (float(values.median()) - 1.0),
        "error_percent": 100.0 * float((values - 1.0).abs().median()),
        "inside_percent": 100.0 * float((rows["normal"].dropna().abs() < NORMAL_95).mean()),
        "prediction_percent": 100.0 * float(np.sqrt((predicted**2).mean())),
    }


def draw(found: DataFrame) -> Drawing:
    figure = Drawing()
    panels = figure.subplots(1, len(COEFFICIENTS), sharey=True)
    gaits = list(found["gait"].unique())
    for panel, name in zip(panels, COEFFICIENTS, strict=True):
        panel.axhspan(0.9, 1.1, alpha=0.2)
        for place, gait in enumerate(gaits):
            ratios = found[(found["gait"] == gait) & (found["coefficient"] == name)]["ratio"].dropna()
            panel.plot(np.full(len(ratios), place), ratios, ".", alpha=0.4)
        panel.set_xticks(range(len(gaits)), gaits, rotation=45)
        panel.set(title=name)
    panels[0].set_ylabel("estimate over truth")
    return figure
