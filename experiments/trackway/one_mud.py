"""Walks in one endless mud, a given number of strides long: how fast each constant depth is, and which is the best.

The first stride starts from a standing body on untouched ground and is not counted; an adaptive robot, which learns
the mud in its first strides, is judged from the third on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
SHALLOWEST_M, DEEPEST_M = 0.015, 0.05  # as far as the adaptation may go


class MudWalk(NamedTuple):
    """What to walk."""

    clay: Clay
    rule: DepthRule
    seed: int
    strides: int = CONSTANT_STRIDES


def run_mud_walk(order: MudWalk) -> Walk:
    track = Track([(ENDLESS_M, order.clay)])
    return walk_by(order.rule, track, order.seed, partial(has, order.strides))


def has(count: int, strides: Sequence[WalkedStride]) -> bool:
    return len(strides) >= count


def speed_cm_s(walk: Walk, skipped: int = STARTING) -> float:
    """Without its first strides; 0 where a fault ended it within them."""
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
    """By mud and depth in metres, over the seeds."""
    speeds: dict[str, dict[float, list[float]]] = {}
    for order, walk in zip(orders, walks, strict=True):
        of_mud = speeds.setdefault(order.clay.name, {})
        of_mud.setdefault(order.rule.depth_m, []).append(speed_cm_s(walk))
    return {mud: {depth: fmean(reported) for depth, reported in of_mud.items()} for mud, of_mud in speeds.items()}


def best_depth(speeds: Mapping[float, float]) -> dict[str, float]:
    """The fastest constant depth and its speed."""
    depth_m = max(speeds, key=lambda each: speeds[each])
    return {"depth_cm": round(100.0 * depth_m, 4), "mean": round(speeds[depth_m], 3)}
