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
from experiments.reports.coefficient_table import compared_frame, compared_rows
from experiments.reports.error_table import error_frame
from experiments.robot.lockstep_robot import simulated_configuration, start_walk
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trials.load_cell_truth import REVERSAL_FRACTION, true_coefficients
from firmware_host.configuration.gait_file import gait_document, read_gait
from firmware_host.operator.reports import stride_report
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
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
    estimates = [row for each in walks["estimates"] for row in each]
    found = compared_frame(estimates).assign(predicted=[row["predicted"] for row in estimates])
    speeds = walks.groupby(["gait", "strength_pa"], sort=False)[["speed_cm_s", "stuck"]].mean().reset_index()
    return Result(
        tables=[
            Table("speeds", "Advance by gait", {"strength_pa": "Pa", "speed_cm_s": "cm/s"}, speeds),
            Table("errors", "Errors by gait and mud", {}, errors_of(found, "setup", "mud", "coefficient")),
            Table("pooled", "Errors by gait, all muds", {}, errors_of(found, "setup", "coefficient")),
        ],
        figures=[Figure("paths", "Estimate over truth by gait; the band is 10 %.", lambda: draw(found))],
    )


def walk(gait: str, strength_pa: float, seed: int, depth_m: float, strides: int) -> dict[str, Any]:
    """Return the speed of a walk, and its estimates with their truths and predictions."""
    clay = Clay(f"{strength_pa:g} Pa", strength_pa)
    order = WalkOrder(depth_m, adaptive=False, strides=strides, gait=read_gait(gait_document(gait)))
    noisy = replace(NONE, current_noise_a=LAB.current_noise_a)
    robot = start_walk(simulated_configuration(), Track([(1000.0, clay)]), seed, order, disturbances=noisy)
    begun_s = robot.now_s
    robot.run_until(lambda: robot.loop.mode is not Mode.WALKING, LONGEST_STRIDE_S * strides)
    closed = [each.estimate for each in robot.loop.learning.strides]
    speed_cm_s = 100.0 * robot.robot.plant.body_m / (robot.now_s - begun_s)
    rows = _compared(closed, clay, robot.loop.configuration.geometry, setup=gait, method="default", trial=seed)
    return {"speed_cm_s": speed_cm_s, "stuck": sum(not each.released for each in closed), "estimates": list(rows)}


def _compared(
    closed: Sequence[StrideEstimate], clay: Clay, geometry: FlipperGeometry, **keys: Any
) -> Iterator[dict[str, Any]]:
    """Yield the rows of each stride, with the logarithm of predicted over estimated value."""
    knowledge = MudKnowledge()
    for stride in closed:
        remembered = knowledge.mud_estimate.of(stride.flipper)
        truths = true_coefficients(_truth_of(stride, clay), geometry, 0.0, 0.0, upright=False)
        for row in compared_rows(stride_report(stride), truths, mud=clay.name, **keys):
            before, row["predicted"] = getattr(remembered, row["coefficient"]), UNKNOWN
            if row["kind"] == "value" and before is not None and not before.at_least:
                row["predicted"] = log(before.at(row["depth_m"])[0] / row["value"])
            if row["truth"] is not None:
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


def errors_of(found: DataFrame, *keys: str) -> DataFrame:
    """Return the errors by these keys, and the RMS error of the predictions."""
    squares = found.assign(square=found["predicted"] ** 2).groupby(list(keys), sort=False)["square"].mean()
    errors = error_frame(found, *keys).assign(prediction=squares.pow(0.5).to_numpy())
    return errors.rename(columns={"setup": "gait"})


def draw(found: DataFrame) -> Drawing:
    figure = Drawing()
    panels = figure.subplots(1, len(COEFFICIENTS), sharey=True)
    gaits, values = list(found["setup"].unique()), found[found["kind"] == "value"]
    for panel, name in zip(panels, COEFFICIENTS, strict=True):
        panel.axhspan(0.9, 1.1, alpha=0.2)
        for place, gait in enumerate(gaits):
            own = values[(values["setup"] == gait) & (values["coefficient"] == name)]
            ratios = own["value"] / own["truth"]
            panel.plot(np.full(len(ratios), place), ratios, ".", alpha=0.4)
        panel.set_xticks(range(len(gaits)), gaits, rotation=45)
        panel.set(title=name)
    panels[0].set_ylabel("estimate over truth")
    return figure
