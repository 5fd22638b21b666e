"""Walks in one endless mud, a given number of strides long: the speed of each constant depth, and the best depth.

The first stride starts from a standing body on untouched ground and is not counted. An adaptive robot learns the mud in
its first two strides and is evaluated from the third on.
"""

from collections.abc import Sequence
from statistics import fmean
from typing import Any

from pandas import DataFrame

from experiments.trackway.depth_rule import rule_of, walk_by
from experiments.trackway.walk import Walk, speed_m_s, walk_of
from simulation.mud.clay import Clay
from simulation.mud.track import Track

ENDLESS_M = 100.0
CONSTANT_STRIDES = 7
STARTING, LEARNING = 1, 2  # strides that are not counted
SHALLOWEST_M, DEEPEST_M = 0.015, 0.05  # the range of the adaptation
DEPTHS_M = tuple(round(SHALLOWEST_M + i * 0.0025, 6) for i in range(15))


def walk_in_mud(
    strength_pa: float, seed: int, depth_m: float = 0.0, method: str = "", count: int = CONSTANT_STRIDES, **plant: Any
) -> dict[str, Any]:
    """Return the entry of a walk of `count` strides at a constant depth, or by a method of adaptation.

    `plant` changes parameters of the simulated robot's body.
    """
    track = Track([(ENDLESS_M, Clay("mud", strength_pa))])
    return walk_by(rule_of(depth_m, method), track, seed, lambda strides: len(strides) >= count, **plant).entry


def speed_cm_s(walk: Walk, skipped: int = STARTING) -> float:
    """Return the speed without the first strides; 0 where a fault ended the walk within them."""
    counted = walk.strides[skipped:]
    return 100.0 * speed_m_s(counted) if counted else 0.0


def constant_rows(strengths_pa: Sequence[float], seeds: int) -> list[dict[str, Any]]:
    """Return the rows of `walk_in_mud` at each constant depth."""
    return [
        {"strength_pa": strength_pa, "depth_m": depth_m, "seed": seed}
        for strength_pa in strengths_pa
        for depth_m in DEPTHS_M
        for seed in range(1, seeds + 1)
    ]


def walks_in(measured: DataFrame) -> list[Walk]:
    """Return the walks of rows that were run."""
    return [walk_of(row) for row in measured.to_dict("records")]


def mean_speeds_cm_s(constant: DataFrame) -> dict[float, float]:
    """Return the mean speed over the seeds in one mud by depth in metres."""
    return {
        depth_m: fmean(speed_cm_s(walk) for walk in walks_in(walks)) for depth_m, walks in constant.groupby("depth_m")
    }


def best_depth(speeds: dict[float, float]) -> dict[str, float]:
    """Return the fastest constant depth, and its speed in cm/s as `mean`."""
    depth_m = max(speeds, key=lambda each: speeds[each])
    return {"depth_cm": round(100.0 * depth_m, 4), "mean": round(speeds[depth_m], 3)}
