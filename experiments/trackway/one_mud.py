"""Walks in one endless mud, a given number of strides long: the speed of each constant depth, and the best depth.

The first stride starts from a standing body on untouched ground and is not counted. An adaptive robot learns the mud in
its first two strides and is evaluated from the third on.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import fmean
from typing import NamedTuple

from experiments.trackway.depth_rule import DepthRule, constant_depth, walk_by
from experiments.trackway.walk import Walk, WalkedStride, speed_m_s
from simulation.mud.clay import Clay
from simulation.mud.track import Track

ENDLESS_M = 100.0
CONSTANT_STRIDES = 7
STARTING, LEARNING = 1, 2  # strides that are not counted
SHALLOWEST_M, DEEPEST_M = 0.015, 0.05  # the range of the adaptation


class MudWalk(NamedTuple):
    """An order for one walk."""

    clay: Clay
    rule: DepthRule
    seed: int
    strides: int = CONSTANT_STRIDES


@dataclass(frozen=True)
class BestDepth:
    """The fastest constant depth and its speed in cm/s."""

    depth_cm: float
    mean: float


def run_mud_walk(order: MudWalk) -> Walk:
    track = Track([(ENDLESS_M, order.clay)])
    return walk_by(order.rule, track, order.seed, partial(has_strides, order.strides))


def has_strides(count: int, strides: Sequence[WalkedStride]) -> bool:
    return len(strides) >= count


def speed_cm_s(walk: Walk, skipped: int = STARTING) -> float:
    """Return the speed without the first strides; 0 where a fault ended the walk within them."""
    counted = walk.strides[skipped:]
    return 100.0 * speed_m_s(counted) if counted else 0.0


def depths_m(step_m: float) -> tuple[float, ...]:
    count = int((DEEPEST_M - SHALLOWEST_M) / step_m + 1e-9) + 1
    return tuple(round(SHALLOWEST_M + i * step_m, 6) for i in range(count))


def constant_walks(clays: Iterable[Clay], depths: Sequence[float], seeds: int) -> list[MudWalk]:
    return [
        MudWalk(clay, constant_depth(depth_m), seed)
        for clay in clays
        for depth_m in depths
        for seed in range(1, seeds + 1)
    ]


def mean_speeds_cm_s(orders: Sequence[MudWalk], walks: Sequence[Walk]) -> dict[str, dict[float, float]]:
    """Average over the seeds, by mud and depth in metres."""
    speeds: dict[str, dict[float, list[float]]] = {}
    for order, walk in zip(orders, walks, strict=True):
        speeds.setdefault(order.clay.name, {}).setdefault(order.rule.depth_m, []).append(speed_cm_s(walk))
    return {mud: {depth: fmean(values) for depth, values in by_depth.items()} for mud, by_depth in speeds.items()}


def best_depth(speeds: Mapping[float, float]) -> BestDepth:
    depth_m = max(speeds, key=lambda each: speeds[each])
    return BestDepth(round(100.0 * depth_m, 4), round(speeds[depth_m], 3))
