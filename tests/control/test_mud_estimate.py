"""A coefficient at another depth, against numpy's power law and against samples drawn from its stated uncertainty."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.mud_estimate import Coefficient, FlipperEstimate, MudEstimate

KNOWN = Coefficient(
    value=0.6e6, std_error=0.04e6, repeatability=0.03e6, depth_m=0.03, exponent=-0.5, exponent_std_error=0.3, strides=8
)
depths = st.floats(0.005, 0.2)


@given(depths, depths, st.floats(-2.0, 1.0))
def test_the_value_follows_the_power_of_depth(own_m: float, other_m: float, exponent: float) -> None:
    value, _ = KNOWN._replace(depth_m=own_m, exponent=exponent).at(other_m)
    assert value == pytest.approx(0.6e6 * float(np.power(other_m / own_m, exponent)))


@pytest.mark.parametrize("depth_m", [0.02, 0.03, 0.04, 0.06])
def test_the_uncertainty_is_the_spread_of_samples_of_level_and_exponent(depth_m: float) -> None:
    random = np.random.default_rng(1)
    coefficient = KNOWN._replace(exponent_std_error=0.1)
    levels = np.log(coefficient.value) + 0.05 * random.standard_normal(200_000)
    exponents = -0.5 + 0.1 * random.standard_normal(200_000)
    spread = float(np.std(levels + exponents * np.log(depth_m / 0.03)))
    value, error = coefficient.at(depth_m)
    assert error / value == pytest.approx(spread, rel=0.01)


@given(st.tuples(*[st.floats()] * 6), st.floats())
def test_no_number_makes_it_raise(numbers: tuple[float, float, float, float, float, float], depth_m: float) -> None:
    value, error = Coefficient(*numbers, 1).at(depth_m)
    assert isinstance(value, float) and isinstance(error, float)


def test_an_estimate_distinguishes_the_flippers() -> None:
    mud_estimate = MudEstimate(left=FlipperEstimate(k_s=KNOWN), right=FlipperEstimate(k_e=KNOWN))
    assert mud_estimate.of("left") == FlipperEstimate(None, KNOWN, None)
    assert mud_estimate.of("right") == FlipperEstimate(None, None, KNOWN)
