"""The coefficients from paths that are no crutching gait, and how well they predict the next stride.

Each gait that ships walks through muds of known strength, with the disturbances of `estimation`. The truth of an
estimate is a plate on a virtual load cell in the mud that the flipper met, at the speed and the depth that the estimate
names (experiments/trials/load_cell_truth.py), so no gait is the reference of another one. The next stride is predicted
by what the robot remembers before it, at the depth that it reaches: its force is the coefficient times a geometry that
is known.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import log
from typing import Annotated, Any

import numpy as np
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from control.gait.stride_table import crutching_parameters
from control.geometry import FlipperGeometry
from control.records import COEFFICIENTS, UNKNOWN, Estimate, StrideEstimate
from estimation.estimation_parameters import EstimationParameters
from estimation.knowledge import MudKnowledge
from experiments.reports.coefficient_table import compared_frame, compared_rows
from experiments.reports.error_table import error_frame
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trials.load_cell_truth import REVERSAL_FRACTION, FlipperTruths, true_strides
from experiments.trials.trial import LATENCY_S, TORQUE_ERROR, WALKING, Setup, replay_trial, run_trial
from firmware_host.configuration.gait_file import gait_document, read_gait
from firmware_host.operator.reports import stride_report
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

GAITS = ("walking", "measuring", "ellipse", "alternating", "backward")
ENDLESS_M = 1000.0


def study(
    trials: Trials,
    *,
    gait: Annotated[tuple[str, ...], Option("name of a gait that ships, or a file", metavar="GAIT")] = GAITS,
    strength: Annotated[tuple[float, ...], Option("of a mud", low=100, high=5e4, unit="Pa")] = (800.0, 1400.0, 3600.0),
    depth: Annotated[float, Option("of insertion", low=1, high=5, unit="cm")] = 3.0,
    strides: Annotated[int, Option("of a walk", low=3, high=200)] = 8,
    seeds: Annotated[int, Option("walks in each mud", low=1, high=100)] = 5,
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
            Table("overall", "Errors of all gaits and muds", {}, errors_of(found, "coefficient")),
        ],
        figures=[Figure("paths", "Estimate over truth by gait; the band is 10 %.", lambda: draw(found))],
    )


def walk(gait: str, strength_pa: float, seed: int, depth_m: float, strides: int) -> dict[str, Any]:
    """Return the speed of a walk, and its estimates with their truths and predictions."""
    clay = Clay(f"{strength_pa:g} Pa", strength_pa)
    track = Track([(ENDLESS_M, clay)])
    trial = run_trial(setup_of(gait, depth_m), track, LAB, strides, seed, TORQUE_ERROR, LATENCY_S)
    first, last = trial.samples[0], trial.samples[-1]
    closed = [stride for stride, _ in replay_trial(trial, EstimationParameters(surface_error_m=LAB.surface_error_m))]
    met = {(truth.flipper, truth.index): truth for truth in trial.truths}
    geometry = trial.configuration.geometry
    strokes = [_strokes_of(each, met[key], geometry) for each in closed if (key := (each.flipper, each.index)) in met]
    truths = true_strides(strokes, trial.configuration, LAB.relaxation)
    rows = _compared(closed, truths, mud=clay.name, setup=gait, method="default", trial=seed)
    return {
        "speed_cm_s": 100.0 * (last.body.x_m - first.body.x_m) / (last.now_s - first.now_s),
        "stuck": sum(not each.released for each in closed),
        "estimates": list(rows),
    }


def setup_of(gait: str, depth_m: float) -> Setup:
    path = read_gait(gait_document(gait))
    parameters = crutching_parameters(path)
    if parameters:
        return replace(WALKING, depth_m=depth_m, gait=parameters)
    return replace(WALKING, depth_m=depth_m, path=path)


def _strokes_of(stride: StrideEstimate, met: StrideTruth, geometry: FlipperGeometry) -> StrideTruth:
    """Return the strokes that the estimates name in the mud that the flipper met, for a load cell to repeat."""

    def stroke(estimate: Estimate, part: float = 1.0) -> StrokeTruth:
        nominal_m = estimate.depth_m / part + stride.surface_m
        lean_rad, depth_m = geometry.adduction_rad(0.0, nominal_m), nominal_m - met.surface_m
        return StrokeTruth(0.0, lean_rad, depth_m, estimate.speed_m_s, UNKNOWN, depth_m)

    return replace(
        met,
        insertion=stroke(stride.k_p),
        stance=stroke(stride.k_s),
        extraction=stroke(stride.k_e, 1.0 - REVERSAL_FRACTION),  # which names the depth where its fit begins
    )


def _compared(closed: Sequence[StrideEstimate], truths: FlipperTruths, **keys: Any) -> Iterator[dict[str, Any]]:
    """Yield the rows of each stride, with the logarithm of predicted over estimated value."""
    knowledge = MudKnowledge()
    for stride in closed:
        remembered = knowledge.mud_estimate.of(stride.flipper)
        for row in compared_rows(stride_report(stride), truths.get((stride.flipper, stride.index), {}), **keys):
            before, row["predicted"] = getattr(remembered, row["coefficient"]), UNKNOWN
            if row["kind"] == "value" and before is not None and not before.at_least:
                row["predicted"] = log(before.at(row["depth_m"])[0] / row["value"])
            if row["truth"] is not None or row["kind"] == "not valid":  # which may name no depth
                yield row
        knowledge.update([stride])


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
