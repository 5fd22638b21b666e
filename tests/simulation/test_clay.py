"""Yield forces of clay, against the stated pressure laws integrated numerically."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulation.clay import MUDS, SUCTION_FADE_M, Clay, Plate, rate_factor

PLATE = Plate(0.025, 0.004)
STRENGTHS = st.floats(200.0, 20000.0)
DEPTHS = st.floats(0.001, 0.15)
WIDTHS = st.floats(0.005, 0.1)
RISING_DEPTHS_M = np.linspace(0.0005, 0.1, 60)


def pressure_n_m(clay: Clay, width_m: float, depths_m: np.ndarray) -> np.ndarray:
    """Matlock's law, per metre of depth, as the module states it."""
    factor = np.minimum(3.0 + 17.5e3 * depths_m / clay.strength_pa + 0.5 * depths_m / width_m, 9.0)
    return clay.strength_pa * width_m * factor


@given(STRENGTHS, DEPTHS, WIDTHS)
def test_the_sideways_force_and_its_depth_are_those_of_the_pressure(
    strength_pa: float, depth_m: float, width_m: float
) -> None:
    clay = Clay("any", strength_pa)
    edges_m = np.linspace(0.0, depth_m, 4001)
    middles_m = (edges_m[1:] + edges_m[:-1]) / 2.0
    slices_n = pressure_n_m(clay, width_m, middles_m) * np.diff(edges_m)
    assert clay.lateral_n(depth_m, width_m) == pytest.approx(slices_n.sum(), rel=1e-5)
    center_m = (slices_n * middles_m).sum() / slices_n.sum()
    assert clay.lateral_center_m(depth_m, width_m) == pytest.approx(center_m, rel=1e-5)


def test_the_forces_on_the_edge_have_these_values() -> None:
    clay, edge_m2, faces_m = Clay("1 kPa", 1000.0), 0.025 * 0.004, 2.0 * 0.029
    assert clay.insertion_n(0.0, PLATE) == pytest.approx(5.14 * 1000.0 * edge_m2)
    adhesion_n = 0.25 * 1000.0 * faces_m * 0.050
    assert clay.insertion_n(0.050, PLATE) == pytest.approx(5.14 * 1000.0 * edge_m2 + adhesion_n)
    assert clay.extraction_n(0.050, PLATE) == pytest.approx(9.0 * 1000.0 * edge_m2 + adhesion_n)
    assert clay.edgewise_n(0.050, PLATE) == pytest.approx(
        9.0 * 1000.0 * 0.004 * 0.050 + 0.25 * 1000.0 * faces_m * 0.050
    )


def test_suction_fades_in_the_last_centimetre() -> None:
    clay = MUDS["45.3"]
    adhesion_n_m = 0.25 * clay.strength_pa * 2.0 * 0.029
    depths_m = (0.0, 0.25 * SUCTION_FADE_M, SUCTION_FADE_M, 0.05)
    suction_n = [clay.extraction_n(depth_m, PLATE) - adhesion_n_m * depth_m for depth_m in depths_m]
    assert suction_n[0] == 0.0
    assert suction_n[1] == pytest.approx(suction_n[2] / 4.0)
    assert suction_n[2] == pytest.approx(suction_n[3])


@pytest.mark.parametrize("law", [Clay.insertion_n, Clay.extraction_n, Clay.edgewise_n, Clay.lateral_n])
@pytest.mark.parametrize("name", MUDS)
def test_forces_rise_with_depth_and_with_strength(law: object, name: str) -> None:
    assert callable(law)
    size = 0.025 if law is Clay.lateral_n else PLATE
    stronger = Clay("stronger", 1.1 * MUDS[name].strength_pa)
    forces_n = [law(MUDS[name], z, size) for z in RISING_DEPTHS_M]
    assert all(before < after for before, after in pairwise(forces_n))
    assert all(law(stronger, z, size) > force_n for z, force_n in zip(RISING_DEPTHS_M, forces_n, strict=True))


def test_the_rate_factor_is_one_at_the_reference_speed_and_rises() -> None:
    assert rate_factor(0.1) == pytest.approx(1.0)
    assert rate_factor(0.0) == pytest.approx(1.0 / (1.0 + 1.99 * 0.1**0.4))
    factors = [rate_factor(speed_m_s) for speed_m_s in np.linspace(0.0, 2.0, 50)]
    assert all(before < after for before, after in pairwise(factors))


def test_wetter_mud_is_weaker() -> None:
    assert MUDS["53.1"].strength_pa < MUDS["48.5"].strength_pa < MUDS["45.3"].strength_pa
