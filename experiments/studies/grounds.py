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
from typing import Annotated, Any

from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from estimation.estimation_parameters import EstimationParameters
from experiments.reports.coefficient_table import compared_frame
from experiments.reports.error_table import error_frame
from experiments.reports.mud_styles import LINES, MARKS
from experiments.reports.style import INK
from experiments.studies.estimation import ENDLESS_M, SETUPS, STRIDES
from experiments.studies.sweep import METHOD_STRIDES, Summary, sweep_of, sweep_row
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from experiments.trackway.simulated_walk import CONSTANT_STRIDES, walk_by
from experiments.trials.load_cell_truth import true_strides
from experiments.trials.trial import LATENCY_S, TORQUE_ERROR, WALKING, compared_trial, configuration_of, run_trial
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

SPEEDS = "Lines: speed at constant depths. Large marks: speed of the robot's own choice, at the median of its depths."


def study(
    trials: Trials,
    *,
    ground: Annotated[tuple[str, ...], Option("ground (default: all)", choices=tuple(GROUNDS))] = tuple(GROUNDS),
    depth: Annotated[tuple[float, ...], Option("constant depth", low=1.5, high=5, unit="cm")] = (1.5, 2, 3, 4, 5),
    seeds: Annotated[int, Option("walks of each point", low=1, high=1000)] = 2,
    estimates: Annotated[int, Option("trials with a load cell of each kind", low=1, high=1000)] = 5,
) -> Result:
    """Speed, choice of depth and estimates on grounds of several laws."""
    numbers, method = range(1, seeds + 1), configuration_of(WALKING).adaptation.method
    gaits: list[dict[str, Any]] = [
        {"method": method, "count": METHOD_STRIDES},
        *({"depth_m": each / 100.0} for each in depth),
    ]
    walked = trials.run(
        walk, [{"ground": name, "seed": n} | gait for name in ground for gait in gaits for n in numbers]
    )
    swept = {name: sweep_of(walked[walked["ground"] == name]) for name in ground}
    parts = [
        {"ground": name, "setup": setup, "seed": n}
        for name in ground
        for setup in ("walking", "single")
        for n in range(1, estimates + 1)
    ]
    found = compared_frame(chain.from_iterable(trials.run(estimate, parts)["rows"]))
    errors = error_frame(found, "mud", "setup", "coefficient").rename(columns={"mud": "ground"})
    pooled = error_frame(found, "coefficient")
    speeds = DataFrame([{"ground": name} | sweep_row(each) for name, each in swept.items()])
    return Result(
        [
            Table("speeds", "Speed at the best constant depth, and of the depth that the robot chooses", {}, speeds),
            Table("errors", "Estimates against a load cell; coverage: of the 95 % intervals", {}, errors),
            Table("pooled", "The same over all grounds and both setups", {}, pooled),
        ],
        [Figure("grounds", SPEEDS, lambda: draw(swept))],
        {"speeds": swept, "errors": errors.to_dict("records"), "pooled": pooled.to_dict("records")},
    )


def disturbances_on(ground: Ground, usual: Disturbances) -> Disturbances:
    """Leave out what the ground brings itself, or cannot have."""
    if isinstance(ground, Clay):
        return usual
    own = replace(usual, remoulding=0.0, relaxation=0.0)
    return replace(own, clinging_n=0.0) if isinstance(ground, Sand) else own


def walk(
    ground: str, seed: int, depth_m: float = 0.0, method: str = "", count: int = CONSTANT_STRIDES
) -> dict[str, Any]:
    """Return the entry of a walk of `count` strides."""
    track, on = Track([(ENDLESS_M, GROUNDS[ground])]), disturbances_on(GROUNDS[ground], TRACKWAY)
    return walk_by(track, seed, lambda strides: len(strides) >= count, depth_m, method, disturbances=on).entry


def estimate(ground: str, setup: str, seed: int) -> dict[str, Any]:
    """Return the estimates of one trial with the load cell's readings of the same strides."""
    law, own = GROUNDS[ground], SETUPS[setup]
    on = disturbances_on(law, LAB)
    trial = run_trial(own, Track([(ENDLESS_M, law)]), on, STRIDES[setup], seed, TORQUE_ERROR, LATENCY_S)
    known = EstimationParameters(fixed_base=own.fixed_base, surface_error_m=LAB.surface_error_m)
    truths = true_strides(trial.truths, trial.configuration, on.relaxation)
    names: dict[str, Any] = {"mud": ground, "setup": own.name, "method": "default"}
    return {"rows": compared_trial(trial, known, [truths], **names)}


def draw(swept: Mapping[str, Summary]) -> Drawing:
    """Draw speed over depth for each ground, and where the robot's own choice lies; each has its own line and mark."""
    figure = Drawing()
    panel = figure.subplots()
    for n, (name, own) in enumerate(swept.items()):
        look: dict[str, Any] = {"color": f"C{n}", "marker": MARKS[(n + n // len(LINES)) % len(MARKS)]}
        line = {"linestyle": LINES[n % len(LINES)], "linewidth": 1.2, "markersize": 3.5}
        panel.plot("depth_cm", "mean", data=DataFrame(own["constant"]), label=name, **look, **line)
        for chosen in own["methods"].values():
            panel.plot(chosen["depth_cm"], chosen["mean"], markersize=9.0, markeredgecolor=INK, **look)
    panel.set(xlabel="depth (cm); large marks: chosen by the robot", ylabel="speed (cm/s)")
    panel.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
