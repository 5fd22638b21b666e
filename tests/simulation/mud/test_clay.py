"""The clay's stresses follow the stated laws, and muds lie between the three that were fitted."""

from itertools import pairwise
from math import nan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulation.mud.clay import MUDS, Clay, clay_of_water, lateral_rise_per_m, rate_factor
from simulation.mud.layer import Layer

STRENGTHS = st.floats(200.0, 20000.0)
DEPTHS = st.floats(0.001, 0.15)
WIDTHS = st.floats(0.005, 0.1)
RISING_DEPTHS_M = np.linspace(0.0005, 0.1, 60)


@given(STRENGTHS, DEPTHS, WIDTHS)
def test_the_sideways_force_is_the_sum_of_the_pressure(strength_pa: float, depth_m: float, width_m: float) -> None:
    edges_m = np.linspace(0.0, depth_m, 4001)
    middles_m = (edges_m[1:] + edges_m[:-1]) / 2.0
    factor = np.minimum(3.0 + 17.5e3 * middles_m / strength_pa + 0.5 * middles_m / width_m, 9.0)
    slices_n = strength_pa * width_m * factor * np.diff(edges_m)
    assert Clay("any", strength_pa).lateral_n(depth_m, width_m) == pytest.approx(slices_n.sum(), rel=1e-5)


@given(STRENGTHS, DEPTHS, WIDTHS)
def test_the_rise_of_the_pressure_factor_is_that_of_the_law(strength_pa: float, depth_m: float, width_m: float) -> None:
    factor = 3.0 + lateral_rise_per_m(strength_pa, width_m) * depth_m
    assert factor == pytest.approx(3.0 + 17.5e3 * depth_m / strength_pa + 0.5 * depth_m / width_m)


CRUSTED = Clay("crusted", 1500.0, (Layer(0.0, 0.008, 3.0), Layer(0.02, 0.035, 0.4)))


@given(DEPTHS, WIDTHS)
def test_the_sideways_force_in_layers_is_the_sum_of_the_pressure(depth_m: float, width_m: float) -> None:
    edges_m = np.linspace(0.0, depth_m, 4001)
    z = (edges_m[1:] + edges_m[:-1]) / 2.0
    strengths_pa = 1500.0 * np.where(z < 0.008, 3.0, np.where((z > 0.02) & (z < 0.035), 0.4, 1.0))
    pressures_pa = strengths_pa * np.minimum(3.0 + 17.5e3 * z / strengths_pa + 0.5 * z / width_m, 9.0)
    slices_n = width_m * pressures_pa * np.diff(edges_m)
    # Three borders, each at most half a slice off in the dense sum.
    uncertainty_n = 1.5 * width_m * 9.0 * 4500.0 * depth_m / 4000
    assert CRUSTED.lateral_n(depth_m, width_m) == pytest.approx(slices_n.sum(), abs=uncertainty_n)


@given(st.floats(0.0, 0.06), st.floats(1e-4, 0.06))
def test_the_mean_strength_of_layers_is_the_mean_of_the_strengths_in_them(from_m: float, span_m: float) -> None:
    z = from_m + span_m * (np.arange(4000) + 0.5) / 4000
    strengths_pa = [CRUSTED.strength_at_pa(depth_m) for depth_m in z]
    uncertainty_pa = 1.5 * (4500.0 - 600.0) / 4000  # three borders, each at most half a piece off in the dense sum
    assert CRUSTED.mean_strength_pa(from_m, from_m + span_m) == pytest.approx(np.mean(strengths_pa), abs=uncertainty_pa)


def test_a_layer_begins_at_its_top_and_ends_at_its_bottom() -> None:
    strengths_pa = [CRUSTED.strength_at_pa(depth_m) for depth_m in (0.0, 0.008, 0.02, 0.035)]
    assert strengths_pa == [4500.0, 1500.0, 600.0, 1500.0]


def test_a_mud_is_scaled_in_all_its_layers() -> None:
    half = CRUSTED.scaled(0.5)
    assert half.name == CRUSTED.name
    for depth_m in (0.004, 0.015, 0.03):
        assert half.strength_at_pa(depth_m) == 0.5 * CRUSTED.strength_at_pa(depth_m)


@pytest.mark.parametrize("name", MUDS)
def test_the_sideways_force_rises_with_depth_and_with_strength(name: str) -> None:
    stronger = Clay("stronger", 1.1 * MUDS[name].strength_pa)
    forces_n = [MUDS[name].lateral_n(depth_m, 0.025) for depth_m in RISING_DEPTHS_M]
    assert all(before < after for before, after in pairwise(forces_n))
    assert all(
        stronger.lateral_n(depth_m, 0.025) > force_n for depth_m, force_n in zip(RISING_DEPTHS_M, forces_n, strict=True)
    )


def test_the_rate_factor_is_one_at_the_reference_speed_and_rises() -> None:
    assert rate_factor(0.1) == pytest.approx(1.0)
    assert rate_factor(0.0) == pytest.approx(1.0 / (1.0 + 0.4 * 0.1**0.4))
    factors = [rate_factor(speed_m_s) for speed_m_s in np.linspace(0.0, 2.0, 50)]
    assert all(before < after for before, after in pairwise(factors))


def test_wetter_mud_is_weaker() -> None:
    strengths_pa = [clay_of_water(percent).strength_pa for percent in np.linspace(44.0, 56.0, 49)]
    assert all(before > after for before, after in pairwise(strengths_pa))


@pytest.mark.parametrize("name", MUDS)
def test_the_fitted_muds_are_reproduced(name: str) -> None:
    clay = clay_of_water(float(name))
    assert clay.name == name
    assert clay.strength_pa == pytest.approx(MUDS[name].strength_pa)


@pytest.mark.parametrize(("dry", "wet"), [("45.3", "48.5"), ("48.5", "53.1")])
def test_half_way_between_two_muds_lies_their_geometric_mean(dry: str, wet: str) -> None:
    between = clay_of_water((float(dry) + float(wet)) / 2.0)
    assert between.strength_pa == pytest.approx(sqrt(MUDS[dry].strength_pa * MUDS[wet].strength_pa))


@pytest.mark.parametrize(("end", "inner", "outer"), [("45.3", 46.5, 44.1), ("53.1", 51.0, 55.2)])
def test_the_slope_continues_beyond_the_outer_muds(end: str, inner: float, outer: float) -> None:
    """Each outer mud lies in the middle between an inner and an extrapolated water content."""
    product = clay_of_water(inner).strength_pa * clay_of_water(outer).strength_pa
    assert product == pytest.approx(MUDS[end].strength_pa ** 2)


def test_a_mud_is_named_after_its_water() -> None:
    assert clay_of_water(47.6).name == "47.6"
    assert clay_of_water(50.0).name == "50"


@pytest.mark.parametrize("percent", [43.99, 56.01, -1.0, nan])
def test_water_contents_outside_of_the_fit_are_refused(percent: float) -> None:
    with pytest.raises(ValueError, match="44 to 56"):
        clay_of_water(percent)


@pytest.mark.parametrize("percent", [44.0, 56.0])
def test_the_ends_of_the_range_are_in_it(percent: float) -> None:
    assert clay_of_water(percent).strength_pa > 0.0
