"""The plan of the sweep, its report of made-up walks, and a small one done for real."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import pytest

from experiments.trackway.depth_sweep import STRENGTHS_PA, Plan, report_of, run
from experiments.trackway.one_mud import MudWalk, constant_walks
from experiments.trackway.walk import Walk, WalkedStride

SMALL = Plan(strengths_pa=(680.0,), methods=("default",), depths_m=(0.02, 0.05), seeds=1, method_strides=4)


def stride(depth_m: float, step_m: float, pushed_back_m: float = 0.0) -> WalkedStride:
    return WalkedStride("680 Pa", 0.0, depth_m, step_m, 2.0, pushed_back_m)


def walked(order: MudWalk) -> Walk:
    """2 cm slips at 2 cm/s, 5 cm makes 6; a method begins at 2 cm and is held once when it goes to 5 cm."""
    if not order.rule.method:
        return Walk([stride(order.rule.depth_m, 0.04 if order.rule.depth_m < 0.03 else 0.12)] * 3, "")
    return Walk([stride(0.02, 0.04)] * 2 + [stride(0.05, 0.06, 0.05), stride(0.05, 0.12), stride(0.045, 0.12)], "")


def made_up(plan: Plan = SMALL) -> dict[str, Any]:
    orders = plan.method_walks() + constant_walks(plan.clays(), plan.depths_m, plan.seeds)
    return report_of(plan, [(order, walked(order)) for order in orders])


def test_by_default_muds_reach_from_soup_to_what_holds_every_flipper() -> None:
    assert len(STRENGTHS_PA) == 12
    assert (STRENGTHS_PA[0], STRENGTHS_PA[-1]) == (300.0, 6000.0)
    assert list(STRENGTHS_PA) == sorted(STRENGTHS_PA)
    assert {order.rule.method for order in Plan().method_walks()} >= {"default", "paper"}


def test_a_method_that_there_is_not_is_named() -> None:
    with pytest.raises(ValueError, match="'fog'"):
        Plan(methods=("fog",)).method_walks()


def test_constant_depths_have_their_speed_and_failures() -> None:
    (row,) = made_up()["strengths"]
    assert row["strength_pa"] == 680.0
    shallow, deep = row["constant"]
    assert (shallow["depth_cm"], shallow["mean"], shallow["failures"]) == (2.0, 2.0, {"slippage": 2})
    assert (deep["depth_cm"], deep["mean"], deep["failures"]) == (5.0, 6.0, {})
    assert row["best"] == {"depth_cm": 5.0, "mean": 6.0}


def test_a_method_is_judged_from_its_third_stride_on() -> None:
    settled = made_up()["strengths"][0]["methods"]["default"]
    assert settled["depth_cm"] == 5.0
    assert settled["depth_range_cm"] == [4.5, 5.0]
    assert settled["mean"] == pytest.approx(5.0)
    assert settled["share_of_best"] == pytest.approx(5.0 / 6.0, abs=0.001)  # rounded
    assert (settled["strides"], settled["failures"]) == (3, {"extraction": 1})


def test_a_mud_in_which_nothing_moves_has_no_best_to_have_a_share_of() -> None:
    still = [(order, Walk([stride(0.02, 0.0)] * 3, "")) for order in _orders()]
    row = report_of(SMALL, still)["strengths"][0]
    assert row["best"]["mean"] == 0.0
    assert row["methods"]["default"]["share_of_best"] is None


def test_a_walk_that_a_fault_ended_early_is_told_and_has_no_depth() -> None:
    broken = [(order, Walk([stride(0.02, 0.1)], "a drive is silent")) for order in _orders()]
    row = report_of(SMALL, broken)["strengths"][0]
    settled = row["methods"]["default"]
    assert (settled["depth_cm"], settled["mean"], settled["faults"]) == (None, 0.0, ["a drive is silent"])
    json.dumps(row, allow_nan=False)


def _orders() -> list[MudWalk]:
    return SMALL.method_walks() + constant_walks(SMALL.clays(), SMALL.depths_m, SMALL.seeds)


@cache
def small() -> dict[str, Any]:
    return run(SMALL, lambda done, total: None)


def test_in_soft_mud_deep_is_faster_and_the_adaptation_goes_deeper_than_it_began() -> None:
    (row,) = small()["strengths"]
    assert row["best"]["depth_cm"] == 5.0
    assert row["constant"][0]["failures"] == {"slippage": 6}
    settled = row["methods"]["default"]
    assert settled["depth_cm"] > 3.0
    assert settled["strides"] == SMALL.method_strides - 2
