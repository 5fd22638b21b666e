"""Tables of errors from synthetic estimates and truths, with numbers that are easy to check."""

from math import nan
from typing import Any

import numpy as np
import pytest
from pandas import DataFrame

from experiments.reports.error_table import KEYS, Row, error_frame, error_rows, plate_rows


def evaluated(value: float, std_error: float = 0.0, **changes: Any) -> Row:
    names = {"setup": "walking", "mud": "49.5", "coefficient": "k_p", "method": "default", "trial": "", "kind": "value"}
    numbers = {"value": value, "std_error": std_error, "repeatability": nan, "truth": 100.0, "upright": 80.0}
    return names | numbers | changes


def error_row(*evaluations: Row) -> Row:
    (row,) = error_rows(DataFrame(evaluations))
    return row


def plate_row(*evaluations: Row) -> Row:
    (row,) = plate_rows(DataFrame(evaluations))
    return row


def bound(value: float, std_error: float = 0.0, kind: str = "bound") -> Row:
    return evaluated(value, std_error, kind=kind)


def test_errors_of_nothing_are_an_empty_table_with_its_columns() -> None:
    found = error_frame(DataFrame(columns=list(evaluated(1.0))), "coefficient")
    assert not len(found) and {"coefficient", "median", "strides"} <= set(found.columns)


def test_median_and_95th_percentile_are_of_the_size_of_the_error() -> None:
    """The errors are -10, 0, 20, 30 and 40 %; the 95th percentile lies at four fifths between 30 and 40 %."""
    row = error_row(*map(evaluated, (90.0, 100.0, 120.0, 130.0, 140.0)))
    assert (row["median"], row["p95"], row["bias"], row["strides"]) == (0.2, 0.38, 0.2, 5)
    assert error_row(*map(evaluated, (80.0, 90.0, 150.0)))["bias"] == -0.1  # the bias is signed


@pytest.mark.parametrize(("std_error", "coverage"), [(5.0, 0.0), (5.2, 1.0)])
def test_the_interval_is_1_96_standard_errors_to_either_side(std_error: float, coverage: float) -> None:
    for value in (90.0, 110.0):
        assert error_row(evaluated(value, std_error))["coverage"] == coverage


def test_bounds_have_no_error_and_are_counted_apart() -> None:
    row = error_row(evaluated(110.0), bound(50.0), bound(90.0), bound(130.0))
    assert (row["median"], row["strides"], row["bounds"]) == (0.1, 1, 3)
    assert (row["bounds_hold"], row["bound_over_truth"]) == (0.6667, 0.9)
    row = error_row(bound(50.0), bound(50.0, kind="not valid"))
    assert {row[name] for name in ("median", "p95", "bias", "coverage")} == {None}
    assert (row["strides"], row["bounds"], row["not_valid"]) == (0, 1, 1)


@pytest.mark.parametrize(("std_error", "hold"), [(5.0, 0.0), (5.2, 1.0)])
def test_a_bound_is_right_if_its_lower_end_is(std_error: float, hold: float) -> None:
    assert error_row(bound(110.0, std_error))["bounds_hold"] == hold


def test_there_is_a_row_for_each_setup_mud_coefficient_and_method_in_their_order() -> None:
    changes = ({"method": "paper"}, {"mud": "47.6"}, {"method": "paper"}, {"coefficient": "k_s"}, {"setup": "single"})
    rows = error_rows(DataFrame([evaluated(1.0) | each for each in changes]))
    assert [tuple(row[name] for name in KEYS) + (row["strides"],) for row in rows] == [
        ("walking", "49.5", "k_p", "paper", 2),
        ("walking", "47.6", "k_p", "default", 1),
        ("walking", "49.5", "k_s", "default", 1),
        ("single", "49.5", "k_p", "default", 1),
    ]


# the upright plate


@pytest.mark.parametrize(
    ("value", "truth", "parts"),
    [
        (104.0, 100.0, (0.8, 1.3, 0.8333)),  # the lean explains 0.25 of a difference of 0.30
        (80.0, 100.0, (0.8, 1.0, 0.5)),  # the lean adds 0.25 and the estimate subtracts it again
        (80.0, 80.0, (1.0, 1.0, 0.0)),  # no difference
    ],
)
def test_a_difference_is_divided_between_the_lean_and_the_estimate(
    value: float, truth: float, parts: tuple[float, float, float]
) -> None:
    row = plate_row(evaluated(value, truth=truth))
    assert (row["upright_over_leaning"], row["estimate_over_upright"], row["lean_fraction"]) == parts


def test_the_plates_are_medians_of_the_default_with_a_pose() -> None:
    reported = [evaluated(104.0), evaluated(104.0), evaluated(999.0, upright=1.0)]
    others = [
        evaluated(500.0, method="paper"),
        evaluated(500.0, setup="walking without pose"),
        evaluated(500.0, upright=nan),
    ]
    row = plate_row(*reported, *others)
    assert (row["setup"], row["mud"], row["coefficient"]) == ("walking", "49.5", "k_p")
    assert (row["upright_over_leaning"], row["estimate_over_upright"]) == (0.8, 1.3)


@pytest.mark.parametrize("claimed", [0.05, 0.02])
def test_the_scatter_of_a_trials_strides_is_compared_with_the_claim_and_its_bias_is_not(claimed: float) -> None:
    """Each of 30 trials has a bias of its own of 20 %, and its five strides scatter by 5 %."""
    random = np.random.default_rng(8)
    rows = []
    for trial in range(30):
        level = 1e6 * np.exp(0.2 * random.standard_normal())
        for value in (level * np.exp(0.05 * random.standard_normal(5))).tolist():
            rows.append(evaluated(value, truth=1e6, repeatability=claimed * value, trial=str(trial)))
    assert error_row(*rows)["chi"] == pytest.approx(0.05 / claimed, rel=0.15)
