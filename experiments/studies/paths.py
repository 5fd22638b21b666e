"""The coefficients from paths that are no crutching gait, and how well they predict the next stride.

Each gait that ships walks over grounds of three laws, with the disturbances of `grounds`. The truth of an estimate is a
plate on a virtual load cell in the ground that the flipper met, at the speed and the depth that the estimate names
(experiments/trials/load_cell_truth.py), so no gait is the reference of another one. The next stride's torques are
predicted by what the robot remembers before it, at the depth that it reaches: the coefficient times a geometry that is
known. They are compared with the ground's true torques wherever the coefficient is fitted, and the root mean square of
the difference is given as a fraction of the stride's largest torque, next to the one that the law itself leaves
(experiments/trials/predicted_load.py).
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from control.gait.stride_table import crutching_parameters
from control.geometry import FlipperGeometry
from control.mud_estimate import FlipperEstimate
from control.records import COEFFICIENTS, UNKNOWN, Estimate, StrideEstimate
from estimation.estimation_parameters import EstimationParameters
from estimation.knowledge import MudKnowledge
from experiments.reports.coefficient_table import compared_frame, compared_rows
from experiments.reports.error_table import Row, error_frame
from experiments.studies.estimation import ENDLESS_M
from experiments.studies.grounds import GROUNDS, disturbances_on
from experiments.study.option import Option, OptionError
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trials.load_cell_truth import REVERSAL_FRACTION, FlipperTruths, true_strides
from experiments.trials.predicted_load import LoadError, load_errors
from experiments.trials.trial import (
    LATENCY_S,
    TORQUE_ERROR,
    WALKING,
    Setup,
    Trial,
    configuration_of,
    replay_trial,
    run_trial,
)
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_checks import gait_problems
from firmware_host.configuration.gait_file import as_json, gait_document, read_gait
from firmware_host.operator.reports import stride_report
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

GAITS = ("walking", "measuring", "ellipse", "alternating", "backward")
WALKED = ("clay-0.8", "clay-1.4", "clay-3.6", "thixotropic", "sand-generic")
UNPREDICTED = LoadError(UNKNOWN, UNKNOWN)
KEYS = {"gait": "setup", "ground": "mud", "law": "mud"}  # of the rows of estimates


def study(
    trials: Trials,
    *,
    gait: Annotated[tuple[str, ...], Option("name of a gait that ships, or a file", metavar="GAIT")] = GAITS,
    ground: Annotated[tuple[str, ...], Option("ground", choices=tuple(GROUNDS))] = WALKED,
    depth: Annotated[float, Option("of insertion", low=1, high=5, unit="cm")] = 3.0,
    strides: Annotated[int, Option("of a walk", low=3, high=200)] = 8,
    seeds: Annotated[int, Option("walks on each ground", low=1, high=100)] = 5,
) -> Result:
    """The coefficients of a ground from paths other than the crutching gait."""
    documents = {name: gait_document(name) for name in gait}
    for document in documents.values():
        if problems := list(gait_problems(read_gait(document), configuration_of(WALKING), (depth / 100.0,))):
            raise ConfigurationError(problems)  # before anything runs
    walked = {"depth_m": depth / 100.0, "strides": strides}
    rows = [
        {"gait": name, "document": as_json(document), "ground": each, "seed": seed, **walked}
        for name, document in documents.items()
        for each in ground
        for seed in range(1, seeds + 1)
    ]
    walks = trials.run(walk, rows)
    estimates = [row for each in walks["estimates"] for row in each]
    if not estimates:
        raise OptionError("no flipper of these walks was in the ground, so there is nothing to evaluate")
    found = with_load_errors(estimates)
    by_law = found.assign(mud=found["mud"].str.partition("-")[0])
    speeds = walks.groupby(["gait", "ground"], sort=False)[["speed_cm_s", "stuck"]].mean().reset_index()
    return Result(
        tables=[
            Table("speeds", "Advance by gait", {"speed_cm_s": "cm/s"}, speeds),
            Table("errors", "Errors by gait and ground", {}, errors_of(found, "gait", "ground", "coefficient")),
            Table("pooled", "Errors by gait and law", {}, errors_of(by_law, "gait", "law", "coefficient")),
            Table("laws", "Errors by law, all gaits", {}, errors_of(by_law, "law", "coefficient")),
        ],
        figures=[Figure("paths", "Estimate over truth by gait; the band is 10 %.", lambda: draw(found))],
    )


def walk(gait: str, document: str, ground: str, seed: int, depth_m: float, strides: int) -> dict[str, Any]:
    """Return the speed of a walk, and its estimates with their truths and the errors of their predictions."""
    track, on = Track([(ENDLESS_M, GROUNDS[ground])]), disturbances_on(GROUNDS[ground], LAB)
    trial = run_trial(setup_of(document, depth_m), track, on, strides, seed, TORQUE_ERROR, LATENCY_S)
    first, last = trial.samples[0], trial.samples[-1]
    closed = [stride for stride, _ in replay_trial(trial, EstimationParameters(surface_error_m=LAB.surface_error_m))]
    met = {(truth.flipper, truth.index): truth for truth in trial.truths}
    geometry = trial.configuration.geometry
    strokes = [_strokes_of(each, met[key], geometry) for each in closed if (key := (each.flipper, each.index)) in met]
    truths = true_strides(strokes, trial.configuration, on.relaxation)
    rows = _compared(trial, truths, closed, mud=ground, setup=gait, method="default")
    return {
        "speed_cm_s": 100.0 * (last.body.x_m - first.body.x_m) / (last.now_s - first.now_s),
        "stuck": sum(not each.released for each in closed),
        "estimates": list(rows),
    }


def setup_of(document: str, depth_m: float) -> Setup:
    path = read_gait(json.loads(document))
    parameters = crutching_parameters(path)
    if parameters:
        return replace(WALKING, depth_m=depth_m, gait=parameters)
    return replace(WALKING, depth_m=depth_m, path=path)


def _strokes_of(stride: StrideEstimate, met: StrideTruth, geometry: FlipperGeometry) -> StrideTruth:
    """Return the strokes that the estimates name in the ground that the flipper met, for a load cell to repeat.

    Of a path only the whole stay is known (path_reference.py): what it is longer than the way down and up is across.
    """
    across_m = met.stance.path_m or max(0.0, met.insertion.path_m - 2.0 * met.insertion.deepest_m)

    def stroke(estimate: Estimate, part: float = 1.0) -> StrokeTruth:
        nominal_m = estimate.depth_m / part + stride.surface_m
        lean_rad, depth_m = geometry.adduction_rad(0.0, nominal_m), nominal_m - met.surface_m
        return StrokeTruth(0.0, lean_rad, depth_m, estimate.speed_m_s, UNKNOWN, depth_m, across_m)

    rising = stroke(stride.k_e, 1.0 - REVERSAL_FRACTION)  # which names the depth where its fit begins
    return replace(met, insertion=stroke(stride.k_p), stance=stroke(stride.k_s), extraction=rising)


def _compared(trial: Trial, truths: FlipperTruths, closed: Sequence[StrideEstimate], **keys: Any) -> Iterator[Row]:
    """Yield the rows of each stride, with the error of the load that the strides before it predict."""
    knowledge = MudKnowledge()
    for stride in closed:
        errors = _load_errors(trial, stride, knowledge.mud_estimate.of(stride.flipper))
        for row in compared_rows(stride_report(stride), truths.get((stride.flipper, stride.index), {}), **keys):
            if row["truth"] is not None or row["kind"] == "not valid":  # which may name no depth
                yield row | {"trial": trial.seed, "load_error": errors.get(row["coefficient"], UNPREDICTED)}
        knowledge.update([stride])


def _load_errors(trial: Trial, stride: StrideEstimate, remembered: FlipperEstimate) -> Mapping[str, LoadError]:
    predicted = {}
    for name in COEFFICIENTS:
        found, before = getattr(stride, name), getattr(remembered, name)
        if before and not before.at_least and found.valid and not found.at_least:
            predicted[name] = before.at(found.depth_m)[0]
    loads = [load for load in trial.loads[stride.flipper] if stride.t_start_s <= load.now_s <= stride.t_end_s]
    return load_errors(loads, trial.configuration.geometry, stride.surface_m, predicted)


def with_load_errors(rows: Sequence[Row]) -> DataFrame:
    """Return the frame of the estimates with the squares of both errors of their load."""
    squares = np.square([row["load_error"] for row in rows]).T
    return compared_frame(rows).assign(**dict(zip(LoadError._fields, squares, strict=True)))


def errors_of(found: DataFrame, *names: str) -> DataFrame:
    """Return the errors by these keys, and the root mean squares of the errors of the load."""
    keys = [KEYS.get(name, name) for name in names]
    squares = found.groupby(keys, sort=False)[[*LoadError._fields]].mean()
    errors = error_frame(found, *keys).join(squares.pow(0.5).reset_index(drop=True))
    return errors.rename(columns=dict(zip(keys, names, strict=True)))


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
