"""Speed against depth in mud from soup to firm clay, and where each method of adaptation settles.

In every strength the robot walks at constant depths, and then as each method chooses, long enough to settle. A method
is judged from its third stride on: its speed there beside that of the best constant depth, and its failed strides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from statistics import fmean, median
from typing import Any

from experiments.trackway.depth_rule import METHODS, chosen_by, configuration_for
from experiments.trackway.one_mud import (
    CONSTANT_STRIDES,
    LEARNING,
    STARTING,
    MudWalk,
    best_depth,
    constant_walks,
    depths_m,
    mean_speeds_cm_s,
    run_mud_walk,
    speed_cm_s,
)
from experiments.trackway.speed_table import failures
from experiments.trackway.walk import Walk
from experiments.trials.parallel_trials import run_parallel
from experiments.trials.session import Show
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB

STRENGTHS_PA = (300.0, 400.0, 500.0, 680.0, 1000.0, 1500.0, 2000.0, 2800.0, 3250.0, 4000.0, 5000.0, 6000.0)


@dataclass(frozen=True)
class Plan:
    strengths_pa: tuple[float, ...] = STRENGTHS_PA
    methods: tuple[str, ...] = METHODS
    depths_m: tuple[float, ...] = depths_m(0.0025)
    seeds: int = 2
    method_strides: int = 12

    def clays(self) -> list[Clay]:
        return [Clay(f"{strength_pa:g} Pa", strength_pa) for strength_pa in self.strengths_pa]

    def method_walks(self) -> list[MudWalk]:
        rules = [chosen_by(method) for method in self.methods]
        seeds = range(1, self.seeds + 1)
        return [
            MudWalk(clay, rule, seed, self.method_strides) for clay in self.clays() for rule in rules for seed in seeds
        ]


CompletedWalk = tuple[MudWalk, Walk]


def run(plan: Plan, show: Show, processes: int | None = None) -> dict[str, Any]:
    orders = plan.method_walks() + constant_walks(plan.clays(), plan.depths_m, plan.seeds)  # the longest first
    walks = run_parallel([partial(run_mud_walk, order) for order in orders], show, processes)
    return report_of(plan, list(zip(orders, walks, strict=True)))


def report_of(plan: Plan, walked: Sequence[CompletedWalk]) -> dict[str, Any]:
    return {
        "experiment": "sweep",
        "strengths": [_of_strength(clay, [w for w in walked if w[0].clay == clay]) for clay in plan.clays()],
        "settings": {
            "methods": list(plan.methods),
            "seeds": plan.seeds,
            "constant_strides": CONSTANT_STRIDES,
            "method_strides": plan.method_strides,
            "disturbances": asdict(LAB),
        },
    }


def _of_strength(clay: Clay, walked: Sequence[CompletedWalk]) -> dict[str, Any]:
    constant = [(order, walk) for order, walk in walked if not order.rule.method]
    speeds = mean_speeds_cm_s(*zip(*constant, strict=True))[clay.name]
    best = best_depth(speeds)
    methods = dict.fromkeys(order.rule.method for order, _ in walked if order.rule.method)
    return {
        "strength_pa": clay.strength_pa,
        "constant": [
            {
                "depth_cm": round(100.0 * depth_m, 4),
                "mean": round(speed, 3),
                **_failed([walk for order, walk in constant if order.rule.depth_m == depth_m], STARTING),
            }
            for depth_m, speed in speeds.items()
        ],
        "best": best,
        "methods": {
            method: _settled([walk for order, walk in walked if order.rule.method == method], best["mean"])
            for method in methods
        },
    }


def _settled(walks: Sequence[Walk], best_cm_s: float) -> dict[str, Any]:
    """Where a method came to after its second stride."""
    depths = [stride.depth_m for walk in walks for stride in walk.strides[LEARNING:]]
    mean = fmean(speed_cm_s(walk, LEARNING) for walk in walks)
    return {
        "depth_cm": round(100.0 * median(depths), 3) if depths else None,
        "depth_range_cm": [round(100.0 * edge, 3) for edge in (min(depths), max(depths))] if depths else None,
        "mean": round(mean, 3),
        "share_of_best": round(mean / best_cm_s, 3) if best_cm_s > 0.0 else None,
        **_failed(walks, LEARNING),
    }


def _failed(walks: Sequence[Walk], skipped: int) -> dict[str, Any]:
    arm_m = configuration_for(chosen_by(METHODS[0])).geometry.flipper_length_m
    counted = [walk.strides[skipped:] for walk in walks]
    return {
        "strides": sum(len(strides) for strides in counted),
        "failures": failures(counted, arm_m),
        "faults": sorted({walk.fault for walk in walks if walk.fault}),
    }
