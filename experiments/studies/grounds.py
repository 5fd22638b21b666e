"""What of the results belongs to the simulator's clay: speed, choice of depth and estimates on grounds of other laws.

The robot walks on each ground at constant depths and by the default choice of depth, with the estimator as it is: no
constant is fitted to a ground. The disturbances are those of `sweep` and `estimation`, without those that a ground
brings itself (remoulding and relaxation of thixotropic mud) or cannot have (sand that clings). Truth is the load
cell's in the same ground, as in `estimation`: a coefficient of a law that the ground does not have is that of the best
fit to the same stroke.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from math import sqrt
from statistics import median
from typing import Annotated, Any

from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from estimation.estimation_parameters import EstimationParameters
from experiments.reports.coefficient_table import compared_frame, compared_rows
from experiments.reports.error_table import error_rows
from experiments.studies.estimation import ENDLESS_M, SETUPS, STRIDES
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trackway.simulated_walk import CONSTANT_STRIDES, LEARNING, STARTING, arm_m, speed_cm_s, walk_by
from experiments.trackway.walk import EXTRACTION, RECOVERED
from experiments.trials.load_cell_truth import true_coefficients
from experiments.trials.trial import LATENCY_S, TORQUE_ERROR, WALKING, configuration_of, replay_trial, run_trial
from firmware_host.operator.reports import stride_report
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB, TRACKWAY, Disturbances
from simulation.mud.ground_contact import Ground
from simulation.mud.grounds.sand import Sand
from simulation.mud.grounds.thixotropic_mud import ThixotropicMud
from simulation.mud.grounds.thixotropy import Thixotropy
from simulation.mud.layer import Layer
from simulation.mud.track import Track

STEP_M, KNOWN_M = 0.006, 0.03  # of the strength that grows with depth, and where it is the named one
GROWING = tuple(Layer(n * STEP_M, (n + 1) * STEP_M, sqrt((n + 0.5) * STEP_M / KNOWN_M)) for n in range(12))
MIDDLE = Clay("1.4 kPa", 1400.0)
SLOW = ThixotropicMud(MIDDLE, Thixotropy(recovery_s=600.0))
GROUNDS: Mapping[str, Ground] = {
    "clay-0.8": Clay("0.8 kPa", 800.0),
    "clay-1.4": MIDDLE,
    "clay-3.6": Clay("3.6 kPa", 3600.0),
    "growing": Clay("growing", 1400.0, GROWING),
    "crust": Clay("crust", 800.0, (Layer(0.0, 0.008, 4.0),)),
    "floor": Clay("floor", 800.0, (Layer(0.03, 1.0, 20.0),)),
    "thixotropic": ThixotropicMud(MIDDLE),
    "thixotropic-slow": SLOW,
    "sand-generic": Sand("sand", 1.55e6),
    "sand-spatial": Sand("sand", 1.55e6, spatial=True),
}
METHOD_STRIDES = 12
ERRORS = ("median", "bias", "coverage", "strides", "bounds", "bounds_hold", "not_valid")


def study(
    trials: Trials,
    *,
    ground: Annotated[tuple[str, ...], Option("ground (default: all)", choices=tuple(GROUNDS))] = tuple(GROUNDS),
    depth: Annotated[tuple[float, ...], Option("constant depth", low=1.5, high=5, unit="cm")] = (1.5, 2, 3, 4, 5),
    seeds: Annotated[int, Option("walks of each point", low=1, high=1000)] = 2,
    estimates: Annotated[int, Option("trials with a load cell of each kind", low=1, high=1000)] = 5,
) -> Result:
    """Speed, choice of depth and estimates on grounds of several laws."""
    numbers = range(1, seeds + 1)
    rows = [{"ground": name, "depth_cm": each, "seed": n} for name in ground for each in (*depth, 0.0) for n in numbers]
    walked = trials.run(walk, rows)
    parts = [
        {"ground": name, "setup": setup, "seed": n}
        for name in ground
        for setup in ("walking", "single")
        for n in range(1, estimates + 1)
    ]
    found = compared_frame(chain.from_iterable(trials.run(estimate, parts)["rows"]))
    errors = DataFrame(error_rows(found))[["mud", "setup", "coefficient", *ERRORS]].rename(columns={"mud": "ground"})
    speeds = DataFrame([_speeds(name, walked[walked["ground"] == name]) for name in ground])
    return Result(
        [
            Table("speeds", "Speed at constant depths (cm/s), and of the depth that the robot chooses", {}, speeds),
            Table("errors", "Estimates against a load cell; coverage: of the 95 % intervals", {}, errors),
        ],
        [Figure("grounds", "Speed by depth.", lambda: draw(walked))],
    )


def disturbances_on(ground: Ground, usual: Disturbances) -> Disturbances:
    """Leave out what the ground brings itself, or cannot have."""
    if isinstance(ground, Clay):
        return usual
    own = replace(usual, remoulding=0.0, relaxation=0.0)
    return replace(own, clinging_n=0.0) if isinstance(ground, Sand) else own


def walk(ground: str, depth_cm: float, seed: int) -> dict[str, Any]:
    """Walk at a constant depth; at 0 by the default choice."""
    law = GROUNDS[ground]
    method = "" if depth_cm else configuration_of(WALKING).adaptation.method
    count, skipped = (CONSTANT_STRIDES, STARTING) if depth_cm else (METHOD_STRIDES, LEARNING)
    on = disturbances_on(law, TRACKWAY)
    track = Track([(ENDLESS_M, law)])
    walked = walk_by(track, seed, lambda strides: len(strides) >= count, depth_cm / 100.0, method, disturbances=on)
    counted = walked.strides[skipped:]
    stuck = sum(each.failure(arm_m()) in (EXTRACTION, RECOVERED) for each in counted)
    chosen = [100.0 * each.depth_m for each in counted]
    chosen_cm = {"chosen_cm": median(chosen) if chosen else depth_cm}
    return {"cm_s": speed_cm_s(walked, skipped), "stuck": stuck, "strides": len(counted)} | chosen_cm


def _speeds(name: str, walked: DataFrame) -> dict[str, Any]:
    means = walked.groupby("depth_cm")[["cm_s", "chosen_cm"]].mean()
    best = means["cm_s"].drop(0.0).max()
    row = {"ground": name} | {f"{depth:g} cm": round(own["cm_s"], 2) for depth, own in means.drop(0.0).iterrows()}
    row |= {"chosen": f"{means.loc[0.0, 'chosen_cm']:.1f} cm", "speed": round(means.loc[0.0, "cm_s"], 2)}
    row["of the best"] = f"{100.0 * row['speed'] / best:.0f} %" if best > 0.0 else "-"
    for kind, own in (("constant", walked[walked["depth_cm"] > 0.0]), ("chosen", walked[walked["depth_cm"] == 0.0])):
        row[f"stuck, {kind}"] = f"{own['stuck'].sum()}/{own['strides'].sum()}"
    return row


def estimate(ground: str, setup: str, seed: int) -> dict[str, Any]:
    """Return the estimates of one trial with the load cell's readings of the same strides."""
    law, own = GROUNDS[ground], SETUPS[setup]
    on = disturbances_on(law, LAB)
    trial = run_trial(own, Track([(ENDLESS_M, law)]), on, STRIDES[setup], seed, TORQUE_ERROR, LATENCY_S)
    truths = {
        (each.flipper, each.index): true_coefficients(
            each, trial.configuration.geometry, on.relaxation, own.gait.pause_s, upright=False
        )
        for each in trial.truths
    }
    known = EstimationParameters(fixed_base=own.fixed_base, surface_error_m=LAB.surface_error_m)
    rows: list[dict[str, Any]] = []
    for stride, _ in replay_trial(trial, known):
        keys: dict[str, Any] = {
            "mud": ground,
            "setup": own.name,
            "method": "default",
            "trial": f"{seed} {stride.flipper}",
        }
        truth = truths.get((stride.flipper, stride.index), {})
        rows += [row for row in compared_rows(stride_report(stride), truth, **keys) if row["truth"] is not None]
    return {"rows": rows}


def draw(walked: DataFrame) -> Drawing:
    """Draw speed over depth for each ground, and where the robot's own choice lies."""
    figure = Drawing(figsize=(9.0, 4.5))
    panel = figure.subplots()
    for n, (name, own) in enumerate(walked.groupby("ground", sort=False)):
        means = own.groupby("depth_cm")[["cm_s", "chosen_cm"]].mean()
        constant = means.drop(0.0)
        panel.plot(constant.index, constant["cm_s"], "-", color=f"C{n}", linewidth=1.0, label=name)
        panel.plot(means.loc[0.0, "chosen_cm"], means.loc[0.0, "cm_s"], "o", color=f"C{n}")
    panel.set(xlabel="depth (cm); dots: chosen by the robot", ylabel="speed (cm/s)")
    panel.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
