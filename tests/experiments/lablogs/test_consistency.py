"""In synthetic trials the differences of flippers, contradicting bounds and values in air are counted correctly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from control.records import Estimate
from experiments.lablogs.consistency import agreements, contradictions, count_estimates, flipper_pairs
from tests.experiments.lablogs.synthetic_trials import (
    INVALID,
    make_bound,
    make_stride,
    make_trial,
    make_value,
    make_walk,
)


@pytest.mark.parametrize("claimed", [1.0, 0.5])
def test_flippers_differ_by_0_67_of_a_right_error(claimed: float) -> None:
    values = 5.0 + 0.1 * np.random.default_rng(3).standard_normal((1000, 2))
    walk = make_walk([(make_value(left, 0.1 * claimed), make_value(right, 0.1 * claimed)) for left, right in values])
    found = agreements(flipper_pairs([walk], "default"))
    assert found["k_s"].median == pytest.approx(0.674 / claimed, rel=0.1)
    assert (found["k_s"].n, found["k_p"].n, found["k_p"].median) == (1000, 0, None)
    assert found["all"] == found["k_s"]


def test_only_strides_with_two_values_are_compared_and_no_single_flipper_is() -> None:
    walk = make_walk([(make_value(1.0), make_bound(2.0)), (INVALID, make_value(1.0)), (make_value(1.0),) * 2])
    single = make_trial([make_stride(k_s=make_value(1.0))])
    assert len(flipper_pairs([walk, single], "default")) == 1


def test_a_flipper_that_leaves_the_mud_late_is_compared_too() -> None:
    """Its stride closes up to 0.3 s after the other flipper's."""
    left, right = (make_stride(flipper, k_s=make_value(1.0)) for flipper in ("left", "right"))
    walk = make_trial([replace(left, t_end_s=left.t_end_s + 0.25), right], flippers=("left", "right"))
    assert len(flipper_pairs([walk], "default")) == 1


def contradictions_of(*k_e: Estimate) -> tuple[int, int, int]:
    found = contradictions([make_trial([make_stride(index=i, k_e=each) for i, each in enumerate(k_e)])], "default")
    return found.bounds, found.with_neighbour, found.contradicting


def test_a_bound_contradicts_a_weaker_neighbour_beyond_two_errors() -> None:
    assert contradictions_of(make_value(1.0), make_bound(1.29)) == (1, 1, 1)  # the errors are 0.1 each
    assert contradictions_of(make_value(1.0), make_bound(1.27)) == (1, 1, 0)
    assert contradictions_of(make_bound(9.0), make_value(1.0), make_bound(0.5)) == (2, 2, 1)
    assert contradictions_of(make_bound(9.0), INVALID, make_value(1.0)) == (1, 0, 0)


def test_a_bound_between_two_values_counts_once() -> None:
    assert contradictions_of(make_value(1.0), make_bound(9.0), make_value(1.0)) == (1, 1, 1)


def test_estimates_are_counted_as_values_bounds_and_invalid() -> None:
    counts = count_estimates([make_value(1.0), make_value(2.0), make_bound(1.0), INVALID])
    assert (counts.values, counts.bounds, counts.invalid) == (2, 1, 1)


def test_a_value_that_claims_no_error_is_not_compared() -> None:
    walk = make_walk([(make_value(1.0, 0.0), make_value(2.0, 0.0)), (make_value(1.0), make_value(float("nan")))])
    assert flipper_pairs([walk], "default") == []
