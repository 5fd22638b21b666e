"""Table I from synthetic walks, compared with cells computed by hand, and from the simulated trackway."""

from typing import Any

import pytest

from experiments.trackway.simulated_walk import end_of, walk_trackway
from experiments.trackway.table_one import (
    FIXED_DEPTHS_M,
    PAPER_TABLE,
    Speed,
    speed_cell,
    speed_table,
    table_one,
    within_one_sd,
)
from experiments.trackway.walk import Walk, WalkedStride, walk_of
from simulation.mud.clay import MUDS
from simulation.mud.track import COMPARTMENT_M

ARM_M = 0.12


def stride(step_m: float, mud: str = "a", pushed_back_m: float = 0.0) -> WalkedStride:
    return WalkedStride(mud, 0.0, 0.03, step_m, 2.0, pushed_back_m)


def walked(*steps_m: float) -> Walk:
    return Walk([stride(step_m) for step_m in steps_m], "")


@pytest.mark.parametrize(
    ("walks", "cell"),
    [
        ([walked(0.02, 0.04, 0.10, 0.12)], {"mean": 5.5, "mean_all": 3.5, "short_trials": 0, "strides": 4}),
        ([walked(0.0, 0.0, step_m) for step_m in (0.10, 0.12, 0.14)],
         {"mean": 6.0, "sd": 1.0, "mean_all": 2.0, "sd_all": 0.333, "trials": 3}),
        ([walked(0.10, 0.06), walked(0.0, 0.0, 0.12)], {"mean": 5.0, "short_trials": 1, "failures_after_second": {}}),
        ([Walk([stride(0.10, "b")] * 3 + [stride(0.02), stride(0.02), stride(0.12)], "")], {"mean": 6.0}),
        ([Walk([stride(0.10, "b")], "")], {"mean": None, "mean_all": None, "sd": None, "trials": 0, "failures": {}}),
    ],
)  # fmt: skip
def test_the_first_two_strides_in_a_mud_count_in_one_of_the_means_or_where_there_are_no_others(
    walks: list[Walk], cell: dict[str, Any]
) -> None:
    """The deviation is that between trials, and strides in other muds do not count."""
    assert speed_cell(walks, "a", ARM_M).items() >= cell.items()


def test_failures_are_counted_by_name_in_all_strides_and_after_the_second() -> None:
    held = stride(0.01, pushed_back_m=0.05)
    cell = speed_cell([Walk([held, held, held, stride(0.05), stride(0.12)], "")] * 2, "a", ARM_M)
    assert cell["failures"] == {"extraction": 6, "slippage": 2}
    assert cell["failures_after_second"] == {"extraction": 2, "slippage": 2}


@pytest.mark.parametrize(("mean", "inside"), [(7.1, True), (8.1, True), (7.0, False), (8.2, False), (None, None)])
def test_within_one_sd_uses_the_papers_sd_and_includes_its_edge(mean: float | None, inside: bool | None) -> None:
    assert within_one_sd(mean, Speed(7.6, 0.5)) is inside


def table_of(walks: list[Walk], *muds: str) -> dict[str, Any]:
    return table_one({"3 cm": walks}, ARM_M, {}, {"mud_length_cm": dict.fromkeys(muds, 61.0)})


def test_every_mud_has_the_same_weight_in_the_mean_over_muds_and_one_that_was_not_reached_has_none() -> None:
    walk = Walk([stride(0.14, "a"), stride(0.04, "b"), stride(0.04, "b")], "")
    assert table_of([walk], "a", "b")["mean_over_muds"]["3 cm"] == {"mean": 4.5, "mean_all": 4.5}
    assert table_of([walk], "a", "b", "c")["mean_over_muds"]["3 cm"] == {"mean": None, "mean_all": None}


def test_the_title_counts_the_trials_that_are_in_the_table() -> None:
    both, one = Walk([stride(0.1, "a"), stride(0.1, "b")], ""), walked(0.1)
    for walks, count in (([both, one], "1 to 2 trials"), ([both, both, both], "3 trials"), ([both], "1 trial")):
        assert speed_table(table_of(walks, "a", "b")).title.endswith(f" {count}")


def test_the_table_shows_mean_and_deviation_next_to_the_papers() -> None:
    walks = [Walk([stride(step_m, mud) for mud in MUDS for _ in range(3)], "") for step_m in (0.14, 0.16)]
    _, ours, _, paper = speed_table(table_of(walks, *MUDS)).cells()
    assert ours == ["3 cm", *["7.50 ± 0.71"] * 3, "7.50"]
    assert paper[1:3] == ["7.6 ± 0.5, ours within", "2.1 ± 0.8, ours outside"]


def test_each_stride_is_listed_in_centimetres() -> None:
    table = table_of([Walk([WalkedStride("a", 0.614, 0.0305, 0.04, 2.5, 0.0)], "")], "a")
    assert list(table["walks"]["3 cm"][0][0].values()) == ["a", 61.4, 3.05, 4.0, 2.5, "slippage"]


# in simulation


@pytest.mark.parametrize("gait", FIXED_DEPTHS_M)
def test_a_walk_has_the_speeds_of_the_paper_within_one_standard_deviation(gait: str) -> None:
    """One trial each: the speeds of trials differ by less than 0.1 cm/s, the paper's by 0.3 to 1.0 cm/s."""
    walk = walk_of(walk_trackway(COMPARTMENT_M, 1, FIXED_DEPTHS_M[gait]))
    speeds = {mud: speed_cell([walk], mud, ARM_M)["mean"] for mud in MUDS}
    assert all(within_one_sd(speeds[mud], PAPER_TABLE[gait][mud]) for mud in MUDS), speeds
    assert list(PAPER_TABLE[gait]) == list(MUDS) == list(dict.fromkeys(each.mud for each in walk.strides))
    assert {each.depth_m for each in walk.strides} == {FIXED_DEPTHS_M[gait]}
    assert end_of(walk.strides, 3.0 * COMPARTMENT_M) == "past the end"
    failures = {mud: {each.failure(ARM_M) for each in walk.in_mud(mud)} for mud in MUDS}
    assert ("slippage" in failures["53.1"]) is ("extraction" not in failures["45.3"]) is (gait == "3 cm")
