"""Walks in one mud: the strides that count, and the best depth."""

from __future__ import annotations

import pytest

from experiments.trackway.depth_rule import constant_depth
from experiments.trackway.one_mud import (
    BestDepth,
    MudWalk,
    best_depth,
    depths_m,
    mean_speeds_cm_s,
    run_mud_walk,
    speed_cm_s,
)
from experiments.trackway.walk import Walk, WalkedStride
from simulation.mud.clay import Clay

FIRM, SOFT = Clay("firm", 3000.0), Clay("soft", 700.0)


def walked(*steps_m: float, fault: str = "") -> Walk:
    return Walk([WalkedStride("firm", 0.0, 0.03, step_m, 2.0, 0.0) for step_m in steps_m], fault)


def test_the_first_stride_does_not_count() -> None:
    assert speed_cm_s(walked(0.02, 0.10, 0.14)) == pytest.approx(6.0)
    assert speed_cm_s(walked(0.02, 0.10, 0.14), skipped=2) == pytest.approx(7.0)


def test_a_walk_that_a_fault_stopped_at_its_start_has_no_speed() -> None:
    assert speed_cm_s(walked(0.10, fault="a motor was too hot")) == 0.0


@pytest.mark.parametrize(("step_m", "count"), [(0.0025, 15), (0.005, 8), (0.01, 4)])
def test_depths_go_from_1_5_to_5_cm(step_m: float, count: int) -> None:
    depths = depths_m(step_m)
    assert len(depths) == count
    assert depths[0] == 0.015
    assert depths[-1] <= 0.05
    assert {round(b - a, 9) for a, b in zip(depths, depths[1:], strict=False)} == {step_m}


def test_the_best_depth_is_the_fastest() -> None:
    assert best_depth({0.02: 5.0, 0.0275: 7.12345, 0.05: 6.0}) == BestDepth(2.75, 7.123)


def test_means_are_over_the_seeds_of_a_mud_and_depth() -> None:
    rule, deep = constant_depth(0.03), constant_depth(0.05)
    orders = [MudWalk(FIRM, rule, 1), MudWalk(FIRM, rule, 2), MudWalk(FIRM, deep, 1), MudWalk(SOFT, rule, 1)]
    walks = [walked(0.0, 0.10), walked(0.0, 0.12), walked(0.0, 0.02), walked(0.0, 0.04)]
    speeds = mean_speeds_cm_s(orders, walks)
    assert speeds == {
        "firm": {0.03: pytest.approx(5.5), 0.05: pytest.approx(1.0)},
        "soft": {0.03: pytest.approx(2.0)},
    }


def test_a_simulated_walk_makes_the_ordered_strides_in_its_mud() -> None:
    walk = run_mud_walk(MudWalk(FIRM, constant_depth(0.025), 1, strides=2))
    assert [(stride.mud, stride.depth_m) for stride in walk.strides] == [("firm", 0.025)] * 2
