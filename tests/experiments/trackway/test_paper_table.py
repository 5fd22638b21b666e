"""The paper's numbers, as its text repeats some of them."""

from statistics import fmean

import pytest

from experiments.trackway.paper_table import ADAPTIVE, FIXED_DEPTHS_M, PAPER_TABLE, Speed
from simulation.mud.clay import MUDS


def test_table_one_is_the_papers() -> None:
    assert {rule: [tuple(reported) for reported in row.values()] for rule, row in PAPER_TABLE.items()} == {
        "3 cm": [(7.6, 0.5), (2.1, 0.8), (7.2, 0.5)],
        "5 cm": [(6.6, 0.3), (5.5, 0.7), (3.0, 1.0)],
        "adaptive": [(6.4, 0.4), (5.1, 0.3), (7.2, 0.1)],
    }


def test_its_muds_are_the_simulators_in_the_order_of_the_trackway() -> None:
    assert all(list(row) == list(MUDS) == ["48.5", "53.1", "45.3"] for row in PAPER_TABLE.values())


def test_fixed_depths_are_named_by_their_depth() -> None:
    assert {name: f"{100.0 * depth_m:g} cm" for name, depth_m in FIXED_DEPTHS_M.items()} == {
        "3 cm": "3 cm",
        "5 cm": "5 cm",
    }
    assert set(PAPER_TABLE) == {*FIXED_DEPTHS_M, ADAPTIVE}


def test_the_adaptive_mean_is_the_6_2_of_the_papers_text() -> None:
    assert fmean(reported.mean for reported in PAPER_TABLE[ADAPTIVE].values()) == pytest.approx(
        6.2, abs=0.05
    )  # rounding
    assert Speed(2.1, 0.8) == PAPER_TABLE["3 cm"]["53.1"]
