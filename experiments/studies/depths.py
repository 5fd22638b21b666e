"""How the coefficients of a mud change with depth: walks at several depths in turn, and the exponent m of k ∝ z^m.

On a robot, `mudskipper walk --depth 2 --depth 3 --depth 4` and `mudskipper experiment lablogs` do the same. An exponent
of -2 of k_s is a force that does not depend on the depth: firm mud, in which the motors give way before it does.
"""

from typing import Annotated, Any

from matplotlib.figure import Figure as Drawing
from pandas import DataFrame

from control.controller import WalkOrder
from control.modes import Mode
from estimation.strokes.depth_line import SHEAR_LAW, STROKE_LAW
from experiments.reports.depth_law import fit_depth_law
from experiments.robot.lockstep_robot import simulated_configuration, start_walk
from experiments.study.option import Option
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from firmware_host.mud_learning import STORED_STRIDES
from simulation.mud.clay import Clay
from simulation.mud.disturbances import TRACKWAY
from simulation.mud.track import Track

LAWS = {"k_p": STROKE_LAW, "k_s": SHEAR_LAW, "k_e": STROKE_LAW}
STRIDE_S = 3.0  # at most, without a recovery
MOST_STRIDES = STORED_STRIDES // 2  # the loop stores no more of both flippers
NO_LAW = {"exponent": float("nan"), "std_error": float("nan")}


def study(
    trials: Trials,
    *,
    depth: Annotated[tuple[float, ...], Option("of insertion, in turn", low=1, high=5, unit="cm")] = (2.0, 3.0, 4.0),
    strength: Annotated[tuple[float, ...], Option("of a mud", low=100, high=5e4, unit="Pa")] = (800.0, 1600.0, 3600.0),
    strides: Annotated[int, Option("of a walk", low=4, high=MOST_STRIDES)] = 12,
    seeds: Annotated[int, Option("walks in each mud", low=1, high=100)] = 3,
) -> Result:
    """How the coefficients change with depth, and whether mud does that."""
    walked = {"depths_m": [each / 100.0 for each in depth], "strides": strides}
    rows = [{"strength_pa": each, "seed": seed, **walked} for each in strength for seed in range(1, seeds + 1)]
    walks = trials.run(walk, rows)
    table = DataFrame(
        {"strength_pa": row["strength_pa"], "seed": row["seed"], "coefficient": name, **row[name]}
        for _, row in walks.iterrows()
        for name in LAWS
    )
    laws = Table("laws", "Exponent of depth by mud and walk", {"strength_pa": "Pa"}, table)
    caption = "Exponents by mud, with one standard error; bands: what mud has."
    return Result([laws], [Figure("laws", caption, lambda: draw(table))])


def walk(strength_pa: float, seed: int, depths_m: list[float], strides: int) -> dict[str, Any]:
    """Return the depth law of each coefficient over the strides of both flippers."""
    mud = Track([(1000.0, Clay("mud", strength_pa))])
    order = WalkOrder(depths_m[0], adaptive=False, strides=strides, depths_m=tuple(depths_m))
    robot = start_walk(simulated_configuration(), mud, seed, order, disturbances=TRACKWAY)
    robot.run_until(lambda: robot.loop.mode is Mode.HOLD, STRIDE_S * strides)
    estimates = [closed.estimate for closed in robot.loop.learning.strides]
    return {name: _law([getattr(each, name) for each in estimates]) for name in LAWS}


def _law(estimates: list[Any]) -> dict[str, Any]:
    values = [each for each in estimates if each.valid and not each.at_least]
    columns = ("value", "repeatability", "depth_m")
    law = fit_depth_law(DataFrame([{key: getattr(each, key) for key in columns} for each in values], columns=columns))
    bounds = sum(each.at_least for each in estimates)
    found = {"exponent": law.exponent, "std_error": law.std_error} if law else NO_LAW
    return {"values": len(values), "bounds": bounds, **found}


def draw(table: DataFrame) -> Drawing:
    figure = Drawing()
    panels = figure.subplots(1, len(LAWS), sharex=True, sharey=True)
    for panel, (name, (expected, spread)) in zip(panels, LAWS.items(), strict=True):
        shown = table[table["coefficient"] == name]
        panel.axhspan(expected - spread, expected + spread, alpha=0.2)
        panel.errorbar(1e-3 * shown["strength_pa"], shown["exponent"], shown["std_error"], fmt="o")
        panel.set(title=name, xlabel="strength (kPa)")
    panels[0].set_ylabel("exponent of depth")
    return figure
