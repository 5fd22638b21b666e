"""The depth sweep: its plan, its report and picture of synthetic walks, and a small sweep in simulation."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import experiments.sweep.sweep
from experiments.reports.report_page import to_json
from experiments.sweep.plots import plot_sweep
from experiments.sweep.sweep import STRENGTHS_PA, Plan, SweepReport, report_of, run
from experiments.trackway.one_mud import STARTING, BestDepth, MudWalk, constant_walks
from experiments.trackway.walk import Walk, WalkedStride

SMALL = Plan(strengths_pa=(680.0,), methods=("default",), depths_m=(0.02, 0.05), seeds=1, method_strides=4)


def stride(depth_m: float, step_m: float, pushed_back_m: float = 0.0) -> WalkedStride:
    return WalkedStride("680 Pa", 0.0, depth_m, step_m, 2.0, pushed_back_m)


def walked(order: MudWalk) -> Walk:
    """Return a synthetic walk: 2 cm/s with slip at 2 cm depth, 6 cm/s at 5 cm.

    A method begins at 2 cm and fails once at 5 cm.
    """
    if not order.rule.method:
        return Walk([stride(order.rule.depth_m, 0.04 if order.rule.depth_m < 0.03 else 0.12)] * 3, "")
    return Walk([stride(0.02, 0.04)] * 2 + [stride(0.05, 0.06, 0.05), stride(0.05, 0.12), stride(0.045, 0.12)], "")


def orders(plan: Plan = SMALL) -> list[MudWalk]:
    return plan.method_walks() + constant_walks(plan.clays(), plan.depths_m, plan.seeds)


def synthetic_report(plan: Plan = SMALL) -> SweepReport:
    return report_of(plan, [(order, walked(order)) for order in orders(plan)])


def test_the_default_muds_range_from_soup_to_firm_clay() -> None:
    assert len(STRENGTHS_PA) == 12
    assert (STRENGTHS_PA[0], STRENGTHS_PA[-1]) == (300.0, 6000.0)
    assert list(STRENGTHS_PA) == sorted(STRENGTHS_PA)
    assert {order.rule.method for order in Plan().method_walks()} >= {"default", "paper"}


def test_each_constant_depth_has_its_speed_and_failures() -> None:
    (row,) = synthetic_report().strengths
    assert row.strength_pa == 680.0
    shallow, deep = row.constant
    assert (shallow.depth_cm, shallow.mean, shallow.failures) == (2.0, 2.0, {"slippage": 2})
    assert (deep.depth_cm, deep.mean, deep.failures) == (5.0, 6.0, {})
    assert row.best == BestDepth(5.0, 6.0)


def test_a_method_is_evaluated_from_its_third_stride_on() -> None:
    settled = synthetic_report().strengths[0].methods["default"]
    assert settled.depth_cm == 5.0
    assert settled.depth_range_cm == (4.5, 5.0)
    assert settled.mean == pytest.approx(5.0)
    assert settled.fraction_of_best == pytest.approx(5.0 / 6.0, abs=0.001)  # rounded
    assert (settled.strides, settled.failures) == (3, {"extraction": 1})


def test_a_mud_in_which_nothing_moves_gives_no_fraction_of_the_best() -> None:
    still = [(order, Walk([stride(0.02, 0.0)] * 3, "")) for order in orders()]
    row = report_of(SMALL, still).strengths[0]
    assert row.best.mean == 0.0
    assert row.methods["default"].fraction_of_best is None


def test_a_walk_that_a_fault_ended_early_has_no_depth_and_reports_the_fault() -> None:
    broken = [(order, Walk([stride(0.02, 0.1)], "a drive is silent")) for order in orders()]
    row = report_of(SMALL, broken).strengths[0]
    settled = row.methods["default"]
    assert (settled.depth_cm, settled.mean, settled.faults) == (None, 0.0, ["a drive is silent"])
    json.dumps(to_json(row), allow_nan=False)


def short_walks(*arguments: Any) -> list[MudWalk]:
    """Return the walks over constant depths, each with only two strides that count."""
    return [order._replace(strides=STARTING + 2) for order in constant_walks(*arguments)]


def test_in_soft_mud_deep_strides_are_faster_and_the_adaptation_goes_deeper(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiments.sweep.sweep, "constant_walks", short_walks)
    (row,) = run(SMALL, lambda done, total: None).strengths
    assert row.best.depth_cm == 5.0
    assert row.constant[0].failures == {"slippage": 2}
    settled = row.methods["default"]
    assert settled.depth_cm and settled.depth_cm > 3.0
    assert settled.strides == SMALL.method_strides - 2


def silent_walk(order: MudWalk) -> Walk:
    return Walk([], "a drive is silent")


@pytest.mark.parametrize(
    ("walk_in", "strengths_pa"), [(walked, (300.0, 680.0, 6000.0)), (walked, (680.0,)), (silent_walk, (680.0,))]
)
def test_any_sweep_makes_a_picture(
    walk_in: Callable[[MudWalk], Walk], strengths_pa: tuple[float, ...], tmp_path: Path
) -> None:
    plan = Plan(strengths_pa=strengths_pa, methods=("default",), depths_m=(0.02, 0.05), seeds=1)
    report = report_of(plan, [(order, walk_in(order)) for order in orders(plan)])
    plot_sweep(report, tmp_path / "sweep.png")
    assert (tmp_path / "sweep.png").read_bytes().startswith(b"\x89PNG")
