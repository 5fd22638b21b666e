"""The clay's stresses follow the stated laws, and muds lie between the three that were fitted."""

from math import exp, log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulation.mud.clay import MUDS, Clay, clay_of_water
from simulation.mud.layer import Layer

LAYERS = (Layer(0.0, 0.008, 3.0), Layer(0.02, 0.035, 0.4))
CRUSTED = Clay("crusted", 1500.0, LAYERS)


@pytest.mark.parametrize("layers", [(), LAYERS])
@given(st.floats(200.0, 20000.0), st.floats(0.001, 0.15), st.floats(0.005, 0.1))
def test_the_sideways_force_is_the_sum_of_the_pressure(
    layers: tuple[Layer, ...], strength_pa: float, depth_m: float, width_m: float
) -> None:
    edges_m = np.linspace(0.0, depth_m, 4001)
    z = (edges_m[1:] + edges_m[:-1]) / 2.0
    factors = np.where(z < 0.008, 3.0, np.where((z > 0.02) & (z < 0.035), 0.4, 1.0)) if layers else np.ones(4000)
    strengths_pa = strength_pa * factors
    pressures_pa = strengths_pa * np.minimum(3.0 + 17.5e3 * z / strengths_pa + 0.5 * z / width_m, 9.0)
    # Each border is at most half a slice off in the dense sum.
    uncertainty_n = 0.75 * len(layers) * width_m * 27.0 * strength_pa * depth_m / 4000
    reported_n = Clay("any", strength_pa, layers).lateral_n(depth_m, width_m)
    assert reported_n == pytest.approx((width_m * pressures_pa * np.diff(edges_m)).sum(), rel=1e-5, abs=uncertainty_n)


@given(st.floats(0.0, 0.06), st.floats(1e-4, 0.06))
def test_the_mean_strength_of_layers_is_the_mean_of_the_strengths_in_them(from_m: float, span_m: float) -> None:
    z = from_m + span_m * (np.arange(4000) + 0.5) / 4000
    strengths_pa = [CRUSTED.strength_at_pa(depth_m) for depth_m in z]
    uncertainty_pa = 1.5 * (4500.0 - 600.0) / 4000  # three borders, each at most half a piece off in the dense sum
    assert CRUSTED.mean_strength_pa(from_m, from_m + span_m) == pytest.approx(np.mean(strengths_pa), abs=uncertainty_pa)


def test_a_layer_begins_at_its_top_and_ends_at_its_bottom_and_is_scaled_with_its_mud() -> None:
    for clay, factor in ((CRUSTED, 1.0), (CRUSTED.scaled(0.5), 0.5)):
        strengths_pa = [clay.strength_at_pa(depth_m) for depth_m in (0.0, 0.008, 0.02, 0.035)]
        assert strengths_pa == [factor * 4500.0, factor * 1500.0, factor * 600.0, factor * 1500.0]
        assert clay.name == CRUSTED.name


def test_strengths_lie_on_exponentials_through_the_fitted_muds_and_beyond() -> None:
    dry, middle, wet = ((percent, log(MUDS[f"{percent}"].strength_pa)) for percent in (45.3, 48.5, 53.1))
    for percent in (44.0, 44.1, 45.3, 46.9, 48.5, 50.0, 53.1, 55.2, 56.0):
        (x, y), (next_x, next_y) = (dry, middle) if percent < 48.5 else (middle, wet)
        clay = clay_of_water(percent)
        assert clay.strength_pa == pytest.approx(exp(y + (next_y - y) / (next_x - x) * (percent - x)))
        assert clay.name == f"{percent:g}"
