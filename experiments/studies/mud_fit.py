"""Fit the simulator's muds and rail to the six fixed-depth speeds of the paper's Table I.

Four numbers are fitted, the strength of each mud (simulation/mud/clay.py) and how the rail's drag grows with speed
(simulation/body/plant.py), so that

    chi² = Σ ((v - v_paper) / sd_paper)²      over two depths in three muds

is least. The adaptive speeds are never used, because the adaptation is evaluated by them. With six cells for four
numbers the fit shows that the plant can behave like the paper's trackway, not that it is the same.

Not fitted are the rate coefficient 0.4, with which a plate that stops keeps 86 % of its load (authors' logs: 85 to
90 %; clay: about 10 % for a tenfold speed); the body's mass, assumed to be 1 kg (two simpler models came to 1.0
and 1.7 kg when it was fitted too); bearing, adhesion, suction and the sideways compliance of the mud, from literature
and logs; and the disturbances, from the logs.

The search is a grid, because the speed jumps: in firm mud the speed at 5 cm falls by half within a few per cent of
strength. Each walk of the grid serves all three muds; then a finer grid lies around the best point.
"""

from collections.abc import Iterable
from itertools import product
from math import fsum
from statistics import fmean
from typing import Annotated, Any

from pandas import DataFrame, Series, concat

from experiments.reports.mud_names import mud_label
from experiments.study.option import Option
from experiments.study.result import Result, Table
from experiments.study.trials import Trials
from experiments.trackway.simulated_walk import CONSTANT_STRIDES, speed_cm_s, walk_in_mud, walking_world, walks_in
from experiments.trackway.table_one import FIXED_DEPTHS_M, PAPER_TABLE
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.clay import MUDS

DAMPINGS_N_S_M = (4.0, 5.0, 6.0, 7.0, 8.0)
STRENGTHS_PA = [round(400.0 * 1.12**i) for i in range(23)]  # to 5000 Pa
FINER_DAMPINGS_N_S_M = (-0.5, 0.0, 0.5)  # from the best
FINER_RATIOS = (0.94, 0.97, 1.0, 1.03, 1.06)  # to the best strength
GROUND = ["rail_damping_n_s_m", "strength_pa"]
Ground = tuple[float, float]  # damping of the rail, strength of the mud
Fit = dict[str, Any]


def study(trials: Trials, *, seeds: Annotated[int, Option("walks of each point", low=1, high=1000)] = 2) -> Result:
    """The simulator's muds, fitted to the paper's fixed depths."""
    trials.require_same(**walking_world())
    present: Fit = {
        "rail_damping_n_s_m": PlantParameters().rail_damping_n_s_m,
        "strength_pa": {mud: clay.strength_pa for mud, clay in MUDS.items()},
    }
    first = [(present["rail_damping_n_s_m"], strength_pa) for strength_pa in present["strength_pa"].values()]
    coarse = _chi2(_speeds(trials, [*first, *product(DAMPINGS_N_S_M, STRENGTHS_PA)], seeds))
    speeds = _speeds(trials, _finer_grounds(best_fit(coarse)), seeds)
    speeds = concat([coarse, _chi2(speeds)])
    return result_of(speeds[~speeds.index.duplicated()], present, seeds)


def _finer_grounds(fit: Fit) -> Iterable[Ground]:
    dampings = [max(0.0, fit["rail_damping_n_s_m"] + more) for more in FINER_DAMPINGS_N_S_M]
    strengths_pa = {round(best_pa * ratio) for best_pa in fit["strength_pa"].values() for ratio in FINER_RATIOS}
    return product(dampings, sorted(strengths_pa))


def _speeds(trials: Trials, grounds: Iterable[Ground], seeds: int) -> DataFrame:
    """Return the mean speed over the seeds in cm/s, with a row for each ground and a column for each fixed depth."""
    rows = [
        {"rail_damping_n_s_m": damping, "strength_pa": float(strength_pa), "depth_m": depth_m, "seed": seed}
        for damping, strength_pa in dict.fromkeys(grounds)
        for depth_m in FIXED_DEPTHS_M.values()
        for seed in range(1, seeds + 1)
    ]
    walked = trials.run(walk_in_mud, rows)
    walked["speed_cm_s"] = [speed_cm_s(walk) for walk in walks_in(walked)]
    speeds: DataFrame = walked.groupby([*GROUND, "depth_m"], sort=False)["speed_cm_s"].agg(fmean).unstack(sort=False)
    return speeds


def _chi2(speeds: DataFrame) -> DataFrame:
    """Add a column for each mud: the chi² of its two speeds in the paper's table."""
    for mud in MUDS:
        paper = {depth_m: PAPER_TABLE[rule][mud] for rule, depth_m in FIXED_DEPTHS_M.items()}
        speeds[mud] = sum(((speeds[depth_m] - cell.mean) / cell.sd) ** 2 for depth_m, cell in paper.items())
    return speeds


def chi2_of_damping(speeds: DataFrame) -> dict[float, float]:
    """Return the least chi² of the three muds by damping, each mud at its own best strength."""
    least = speeds.groupby(level=0)[[*MUDS]].min()
    return {damping: fsum(own) for damping, *own in least.itertuples()}


def best_fit(speeds: DataFrame) -> Fit:
    chi2 = chi2_of_damping(speeds)
    damping = min(chi2, key=lambda each: chi2[each])
    strengths_pa = {mud: float(speeds.loc[damping][mud].idxmin()) for mud in MUDS}
    return {"rail_damping_n_s_m": damping, "strength_pa": strengths_pa}


def result_of(speeds: DataFrame, present: Fit, seeds: int) -> Result:
    """Report the best fit next to the values in the repository. `speeds` has the chi² of each mud too."""
    fitted, present = _evaluated(best_fit(speeds), speeds), _evaluated(present, speeds)
    of_best = speeds.loc[fitted["rail_damping_n_s_m"]]
    fitted["strength_range_pa"] = {mud: _strength_range_pa(of_best[mud]) for mud in MUDS}
    chi2 = {f"{damping:g}": round(each, 3) for damping, each in chi2_of_damping(speeds).items()}
    settings = {"seeds": seeds, "strides": CONSTANT_STRIDES, "walked": len(speeds)}
    summary = {"fitted": fitted, "present": present, "chi2_of_damping": chi2, "settings": settings}
    return Result(_tables(fitted, present, chi2), summary=summary)


def _strength_range_pa(chi2: Series) -> list[float]:
    """Return the range of strengths whose chi² is within 1 of the least: about a standard error to either side."""
    near = chi2[chi2 <= chi2.min() + 1.0].index
    return [near.min(), near.max()]


def _evaluated(fit: Fit, speeds: DataFrame) -> Fit:
    """Return the fit with its chi² and its cells of Table I in cm/s."""
    of_mud = {mud: speeds.loc[(fit["rail_damping_n_s_m"], strength)] for mud, strength in fit["strength_pa"].items()}
    cells = {rule: {mud: round(of_mud[mud][depth_m], 3) for mud in MUDS} for rule, depth_m in FIXED_DEPTHS_M.items()}
    return fit | {"chi2": round(fsum(of_mud[mud][mud] for mud in MUDS), 3), "cells": cells}


def _tables(fitted: Fit, present: Fit, chi2: dict[str, float]) -> list[Table]:
    values = [
        {
            "": mud_label(mud),
            "fitted": f"{fitted['strength_pa'][mud]:.0f} Pa",
            "chi² within 1 of it": "{:.0f} to {:.0f} Pa".format(*fitted["strength_range_pa"][mud]),
            "present": f"{present['strength_pa'][mud]:.0f} Pa",
        }
        for mud in MUDS
    ]
    for name, key, text in (("rail damping", "rail_damping_n_s_m", "{:g} N·s/m"), ("chi²", "chi2", "{:.2f}")):
        values.append({"": name, "fitted": text.format(fitted[key]), "present": text.format(present[key])})
    cells = [
        {
            "speed": rule,
            "mud": mud_label(mud),
            "paper": f"{PAPER_TABLE[rule][mud].mean:.1f} ± {PAPER_TABLE[rule][mud].sd:.1f}",
            "fitted": f"{fitted['cells'][rule][mud]:.2f}",
            "present": f"{present['cells'][rule][mud]:.2f}",
        }
        for rule, mud in product(FIXED_DEPTHS_M, MUDS)
    ]
    dampings = DataFrame({"rail damping": chi2.keys(), "least chi²": chi2.values()})
    return [
        Table("values", "Fitted to the six fixed-depth cells of Table I", {}, DataFrame(values).fillna("")),
        Table("cells", "", {"speed": "cm/s"}, DataFrame(cells)),
        Table("dampings", "", {"rail damping": "N·s/m"}, dampings),
    ]
