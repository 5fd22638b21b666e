"""Table I from synthetic walks, compared with cells computed by hand, and the paper's own numbers."""

from __future__ import annotations

import pytest

from experiments.trackway.table_one import PAPER_TABLE, Speed, speed_cell, table_one, within_one_sd
from experiments.trackway.walk import Walk, WalkedStride
from simulation.mud.clay import MUDS

ARM_M = 0.12


def stride(step_m: float, mud: str = "a", duration_s: float = 2.0, pushed_back_m: float = 0.0) -> WalkedStride:
    return WalkedStride(mud, 0.0, 0.03, step_m, duration_s, pushed_back_m)


def walked(*steps_m: float) -> Walk:
    return Walk([stride(step_m) for step_m in steps_m], "")


def test_the_first_two_strides_in_a_mud_count_in_one_of_the_means_only() -> None:
    cell = speed_cell([walked(0.02, 0.04, 0.10, 0.12)], "a", ARM_M)
    assert cell["mean"] == pytest.approx(22.0 / 4.0)
    assert cell["mean_all"] == pytest.approx(28.0 / 8.0)
    assert (cell["trials"], cell["short_trials"], cell["strides"]) == (1, 0, 4)


def test_sd_is_that_between_trials() -> None:
    cell = speed_cell([walked(0.0, 0.0, 0.10), walked(0.0, 0.0, 0.12), walked(0.0, 0.0, 0.14)], "a", ARM_M)
    assert (cell["mean"], cell["sd"]) == (6.0, 1.0)
    assert (cell["mean_all"], cell["sd_all"]) == pytest.approx((2.0, 1.0 / 3.0), abs=0.001)  # rounded


def test_a_trial_of_two_strides_counts_with_both_and_is_reported_as_short() -> None:
    cell = speed_cell([walked(0.10, 0.06), walked(0.0, 0.0, 0.12)], "a", ARM_M)
    assert cell["short_trials"] == 1
    assert cell["mean"] == pytest.approx((4.0 + 6.0) / 2.0)
    assert cell["failures_after_second"] == {}


def test_other_muds_do_not_count_and_the_second_stride_is_that_in_the_mud() -> None:
    steps = [stride(0.10, "b")] * 3 + [stride(0.02), stride(0.02), stride(0.12)]
    assert speed_cell([Walk(steps, "")], "a", ARM_M)["mean"] == 6.0


def test_failures_are_counted_by_name_in_all_strides_and_after_the_second() -> None:
    held = stride(0.01, pushed_back_m=0.05)
    cell = speed_cell([Walk([held, held, held, stride(0.05), stride(0.12)], "")] * 2, "a", ARM_M)
    assert cell["failures"] == {"extraction": 6, "slippage": 2}
    assert cell["failures_after_second"] == {"extraction": 2, "slippage": 2}


def test_a_mud_that_no_trial_reached_has_no_speed() -> None:
    cell = speed_cell([walked(0.1)], "b", ARM_M)
    assert (cell["mean"], cell["mean_all"], cell["sd"]) == (None, None, None)
    assert (cell["trials"], cell["failures"]) == (0, {})
    assert within_one_sd(None, Speed(7.6, 0.5)) is None


@pytest.mark.parametrize(("mean", "inside"), [(7.1, True), (8.1, True), (7.0, False), (8.2, False)])
def test_within_one_sd_uses_the_papers_sd_and_includes_its_edge(mean: float, inside: bool) -> None:
    assert within_one_sd(mean, Speed(7.6, 0.5)) is inside


def test_every_mud_has_the_same_weight_in_the_mean_over_muds_and_one_that_was_not_reached_has_none() -> None:
    walk = Walk([stride(0.14, "a"), stride(0.04, "b"), stride(0.04, "b")], "")

    def mean(*muds: str) -> object:
        settings = {"mud_length_cm": dict.fromkeys(muds, 61.0)}
        return table_one({"3 cm": [walk]}, ARM_M, {}, settings)["mean_over_muds"]["3 cm"]

    assert mean("a", "b") == {"mean": 4.5, "mean_all": 4.5}
    assert mean("a", "b", "c") == {"mean": None, "mean_all": None}


# the paper's own table


def test_table_one_has_the_numbers_of_the_paper_in_the_order_of_the_trackway() -> None:
    assert {rule: [(speed.mean, speed.sd) for speed in row.values()] for rule, row in PAPER_TABLE.items()} == {
        "3 cm": [(7.6, 0.5), (2.1, 0.8), (7.2, 0.5)],
        "5 cm": [(6.6, 0.3), (5.5, 0.7), (3.0, 1.0)],
        "adaptive": [(6.4, 0.4), (5.1, 0.3), (7.2, 0.1)],
    }
    assert all(list(row) == list(MUDS) == ["48.5", "53.1", "45.3"] for row in PAPER_TABLE.values())
