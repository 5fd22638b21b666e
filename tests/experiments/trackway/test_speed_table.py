"""Cells from made-up walks, by hand."""

from __future__ import annotations

import pytest

from experiments.trackway.paper_table import Speed
from experiments.trackway.speed_table import cell, mean_over_muds, within_one_sd
from experiments.trackway.walk import Walk, WalkedStride

ARM_M = 0.12


def stride(step_m: float, mud: str = "a", duration_s: float = 2.0, pushed_back_m: float = 0.0) -> WalkedStride:
    return WalkedStride(mud, 0.0, 0.03, step_m, duration_s, pushed_back_m)


def walked(*steps_m: float) -> Walk:
    return Walk([stride(step_m) for step_m in steps_m], "")


def test_the_first_two_strides_in_a_mud_count_for_one_of_the_means_only() -> None:
    reported = cell([walked(0.02, 0.04, 0.10, 0.12)], "a", ARM_M)
    assert reported["mean"] == pytest.approx(22.0 / 4.0)
    assert reported["mean_all"] == pytest.approx(28.0 / 8.0)
    assert (reported["trials"], reported["short_trials"], reported["strides"]) == (1, 0, 4)


def test_sd_is_that_between_trials() -> None:
    reported = cell([walked(0.0, 0.0, 0.10), walked(0.0, 0.0, 0.12), walked(0.0, 0.0, 0.14)], "a", ARM_M)
    assert (reported["mean"], reported["sd"]) == (6.0, 1.0)
    assert (reported["mean_all"], reported["sd_all"]) == (2.0, pytest.approx(1.0 / 3.0, abs=0.001))  # rounded


def test_one_trial_has_no_sd() -> None:
    assert cell([walked(0.1, 0.1, 0.1)], "a", ARM_M)["sd"] is None


def test_a_trial_of_two_strides_counts_with_both_and_is_told() -> None:
    reported = cell([walked(0.10, 0.06), walked(0.0, 0.0, 0.12)], "a", ARM_M)
    assert reported["short_trials"] == 1
    assert reported["mean"] == pytest.approx((4.0 + 6.0) / 2.0)
    assert reported["failures_after_second"] == {}


def test_other_muds_do_not_count_and_the_second_stride_is_that_in_the_mud() -> None:
    steps = [stride(0.10, "b")] * 3 + [stride(0.02), stride(0.02), stride(0.12)]
    assert cell([Walk(steps, "")], "a", ARM_M)["mean"] == 6.0


def test_failures_are_counted_by_name_in_all_strides_and_after_the_second() -> None:
    held = stride(0.01, pushed_back_m=0.05)
    reported = cell([Walk([held, held, held, stride(0.05), stride(0.12)], "")] * 2, "a", ARM_M)
    assert reported["failures"] == {"extraction": 6, "slippage": 2}
    assert reported["failures_after_second"] == {"extraction": 2, "slippage": 2}


def test_a_mud_that_no_trial_reached_has_no_speed() -> None:
    reported = cell([walked(0.1)], "b", ARM_M)
    assert (reported["mean"], reported["mean_all"], reported["sd"], reported["trials"], reported["failures"]) == (
        None,
        None,
        None,
        0,
        {},
    )
    assert within_one_sd(None, Speed(7.6, 0.5)) is None
    assert mean_over_muds({"a": {"mean": 5.0}, "b": reported}, "mean") is None


@pytest.mark.parametrize(("mean", "inside"), [(7.1, True), (8.1, True), (7.0, False), (8.2, False)])
def test_within_one_sd_takes_the_papers_sd_and_its_edge(mean: float, inside: bool) -> None:
    assert within_one_sd(mean, Speed(7.6, 0.5)) is inside


def test_muds_count_alike_in_the_mean_over_them() -> None:
    assert mean_over_muds({"a": {"mean": 7.0}, "b": {"mean": 2.0}}, "mean") == 4.5
