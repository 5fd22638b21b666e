"""In synthetic logs the differences of flippers, contradicting bounds and the effects of disturbances are recovered."""

from dataclasses import replace

import numpy as np
import pytest

from control.records import Estimate
from experiments.lablogs.comparisons import agreements, contradictions, disturbed_values, flipper_pairs, sensitivity
from experiments.lablogs.estimates import EARLY, LATE, MISSING
from tests.experiments.lablogs.synthetic_trials import (
    INVALID,
    by_default,
    make_bound,
    make_log,
    make_stride,
    make_strides,
    make_value,
    make_walk,
)


@pytest.mark.parametrize("claimed", [1.0, 0.5])
def test_flippers_differ_by_0_67_of_a_right_error(claimed: float) -> None:
    values = 5.0 + 0.1 * np.random.default_rng(3).standard_normal((1000, 2))
    walk = make_walk([(make_value(left, 0.1 * claimed), make_value(right, 0.1 * claimed)) for left, right in values])
    found = agreements(flipper_pairs(by_default(walk)))
    assert found["k_s"]["median"] == pytest.approx(0.674 / claimed, rel=0.1)
    assert found["k_s"]["rms"] == pytest.approx(1.0 / claimed, rel=0.1)
    assert 2.5 < found["k_s"]["largest"] * claimed < 5.0
    assert found["k_s"]["n"] == 1000
    assert found["k_p"] == {"median": None, "rms": None, "largest": None, "n": 0}
    assert found["all"] == found["k_s"]


def test_only_strides_with_two_values_are_compared_and_no_single_flipper_is() -> None:
    """A flipper that leaves the mud late is compared too: its stride closes up to 0.3 s after the other's."""
    free_of_error = (make_value(1.0, 0.0), make_value(2.0, 0.0)), (make_value(1.0), make_value(float("nan")))
    some = (make_value(1.0), make_bound(2.0)), (INVALID, make_value(1.0)), (make_value(1.0),) * 2
    single = make_log([make_stride(k_s=make_value(1.0))])
    assert len(flipper_pairs(by_default(make_walk([*free_of_error, *some]), single))) == 1
    left, right = (make_stride(flipper, k_s=make_value(1.0)) for flipper in ("left", "right"))
    late = make_log([replace(left, t_end_s=left.t_end_s + 0.25), right], flippers=("left", "right"))
    assert len(flipper_pairs(by_default(late))) == 1


@pytest.mark.parametrize(
    ("k_e", "bounds", "with_neighbour", "contradicting"),
    [
        ((make_value(1.0), make_bound(1.29)), 1, 1, 1),  # the errors are 0.1 each
        ((make_value(1.0), make_bound(1.27)), 1, 1, 0),
        ((make_bound(9.0), make_value(1.0), make_bound(0.5)), 2, 2, 1),
        ((make_bound(9.0), INVALID, make_value(1.0)), 1, 0, 0),
        ((make_value(1.0), make_bound(9.0), make_value(1.0)), 1, 1, 1),
    ],
)
def test_a_bound_contradicts_a_weaker_neighbour_beyond_two_errors(
    k_e: tuple[Estimate, ...], bounds: int, with_neighbour: int, contradicting: int
) -> None:
    log = make_log([make_stride(index=i, k_e=each) for i, each in enumerate(k_e)])
    assert list(contradictions(by_default(log)).values()) == [bounds, with_neighbour, contradicting]


def test_ratios_and_moves_of_known_disturbances_are_recovered() -> None:
    log = make_log(
        make_strides(make_value(1.0), make_value(2.0), make_value(4.0), make_bound(3.0)),
        disturbed={
            (LATE, 0): make_strides(make_value(0.9), make_value(2.0), make_value(4.8), make_value(3.0)),
            (EARLY, 0): make_strides(make_value(1.1), INVALID, make_bound(4.0), make_bound(3.0)),
            (MISSING, 1): make_strides(make_value(1.19), make_value(2.21), make_value(4.0), INVALID),
            (MISSING, 2): make_strides(make_value(1.0), make_value(2.0), INVALID, INVALID),
            (MISSING, 3): make_strides(make_value(1.0), make_value(2.0), make_value(4.0), INVALID),
        },
    )
    found = sensitivity(disturbed_values(by_default(log)))
    assert found[LATE]["k_s"] == {"median": 1.0, "smallest": 0.9, "largest": 1.2, "n": 3, "lost": 0}
    assert found[EARLY]["k_s"] == {"median": 1.1, "smallest": 1.1, "largest": 1.1, "n": 1, "lost": 2}
    assert found[MISSING]["k_s"] == {"moved": 0.125, "n": 8, "lost": 1}  # 2.21 is beyond two errors
    assert found[LATE]["k_p"] == {"median": None, "smallest": None, "largest": None, "n": 0, "lost": 0}


def test_a_stride_that_a_disturbance_loses_shifts_no_other() -> None:
    recorded = make_strides(make_value(1.0), make_value(2.0), make_value(4.0))
    found = sensitivity(disturbed_values(by_default(make_log(recorded, disturbed={(LATE, 0): recorded[1:]}))))
    assert found[LATE]["k_s"] == {"median": 1.0, "smallest": 1.0, "largest": 1.0, "n": 2, "lost": 1}
