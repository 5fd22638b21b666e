"""The virtual load cell agrees with closed forms for upright plates and with the flipper's contact for leaning ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from simulation.mud.clay import MUDS, Clay, rate_factor
from simulation.mud.flipper_contact import NO_CONTACT, ArmMotion, FlipperContact, attitude_of
from simulation.mud.ground_contact import Ground
from simulation.mud.grounds.thixotropic_mud import ThixotropicMud
from simulation.mud.layer import Layer
from simulation.test_rig.joint_cell import measure_stroke
from simulation.test_rig.load_cell import STEP_S, LoadCell, measure_shear
from tests.control.test_geometry import rotation

GEOMETRY = FlipperGeometry()
CLAY = MUDS["48.5"]
EDGE_M2 = GEOMETRY.plate_width_m * GEOMETRY.plate_thickness_m
GIRTH_M = 2.0 * (GEOMETRY.plate_width_m + GEOMETRY.plate_thickness_m)


def lowered_rad(sweep_rad: float) -> float:
    return GEOMETRY.adduction_rad(sweep_rad, 0.03)


def strokes(
    depth_m: float, speed_m_s: float, sweep_rad: float = 0.0, adduction_rad: float = 0.0, clay: Clay = CLAY
) -> list[np.ndarray]:
    """Return depths, volumes and forces down and up."""
    cell = LoadCell(clay, GEOMETRY, sweep_rad, adduction_rad)
    return [np.array(curve).T for curve in measure_stroke(cell, depth_m, speed_m_s)]


@given(st.floats(-0.6, 0.6), st.floats(-1.0, 0.0))
def test_the_axes_are_those_of_the_flipper_s_plate(sweep_rad: float, adduction_rad: float) -> None:
    axes = np.array(LoadCell(CLAY, GEOMETRY, sweep_rad, adduction_rad).axes)
    assert pytest.approx(rotation(sweep_rad, adduction_rad)) == axes.T
    attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad)
    assert axes[1:, 2] == pytest.approx((-attitude.per_outward, attitude.per_upward))


@pytest.mark.parametrize("speed_m_s", [0.03, 0.1, 0.4])
def test_an_upright_plate_meets_bearing_suction_and_adhesion_by_its_speed(speed_m_s: float) -> None:
    (z, _, force_n), (z_up, _, force_up_n) = strokes(0.04, speed_m_s)
    strength_pa = rate_factor(speed_m_s) * CLAY.strength_pa
    limits_n = strength_pa * (5.14 * EDGE_M2 + 0.25 * GIRTH_M * z)
    assert force_n[z > 0.01] == pytest.approx(limits_n[z > 0.01], rel=0.03)  # the last millimetre has not yielded yet
    limits_n = strength_pa * (9.0 * EDGE_M2 * np.minimum(z_up / 0.01, 1.0) + 0.25 * GIRTH_M * z_up)
    yielded = (z_up > 0.002) & (z_up < 0.035)
    assert force_up_n[yielded] == pytest.approx(-limits_n[yielded], rel=0.001)


@pytest.mark.parametrize("sweep_rad", [0.0, 0.5, -0.5])
def test_it_goes_from_the_surface_down_to_the_depth_and_up_until_it_is_out(sweep_rad: float) -> None:
    """A plate that leans is inserted harder than an upright one, alike to the front and to the back."""
    (z, _, force_n), (z_up, _, force_up_n) = strokes(0.03, 0.1, sweep_rad, lowered_rad(sweep_rad))
    steps_m = np.diff(z)
    assert min(steps_m) > 0.0 > max(np.diff(z_up))
    assert (z[-1], steps_m[0]) == pytest.approx((0.03, 0.1 * 0.0005), rel=0.01)
    assert force_n[0] < 0.1 * force_n[-1]
    assert force_up_n[-1] == pytest.approx(0.0, abs=1e-3)
    (_, _, upright_n), _ = strokes(0.03, 0.1)
    (_, _, mirrored_n), _ = strokes(0.03, 0.1, -sweep_rad, lowered_rad(sweep_rad))
    assert force_n == pytest.approx(mirrored_n)
    assert force_n[-1] > 1.2 * upright_n[-1] or not sweep_rad


def test_a_hold_of_half_a_second_loses_the_stated_fraction() -> None:
    for relaxation, fractions in ((0.13, (0.88, 0.87)), (0.0, (1.0, 1.0))):
        cell = LoadCell(CLAY, GEOMETRY, 0.0, 0.0, relaxation)
        cell.lower(0.03, 0.1)
        held_n = [cell.step(STEP_S, 0.0, 0.0)[1] for _ in range(round(3.0 / STEP_S))]
        assert (held_n[1000] / held_n[0], held_n[-1] / held_n[0]) == pytest.approx(fractions, abs=0.005)


@pytest.mark.parametrize("sweep_rad", [0.0, 0.4, -0.4])
def test_a_body_that_is_pushed_back_drags_its_flipper_with_the_same_force(sweep_rad: float) -> None:
    adduction_rad, force = lowered_rad(sweep_rad), NO_CONTACT
    contact, attitude = FlipperContact(GEOMETRY), attitude_of(GEOMETRY, sweep_rad, adduction_rad)
    for _ in range(1000):
        force = contact.step(0.001, CLAY, ArmMotion(sweep_rad, adduction_rad, body_m_s=-0.1), attitude)
    for distance_m in (0.06, 0.4):
        shear_n = measure_shear(CLAY, GEOMETRY, sweep_rad, adduction_rad, 0.03, 0.1, distance_m)
        assert force.thrust_n == pytest.approx(shear_n)


@pytest.mark.parametrize(("ground", "softest", "firmest"), [(CLAY, 0.999, 1.001), (ThixotropicMud(CLAY), 0.9, 0.97)])
def test_a_plate_that_comes_in_softens_only_mud_with_a_memory(ground: Ground, softest: float, firmest: float) -> None:
    there_at_once = LoadCell(ground, GEOMETRY, 0.0, 0.0)
    there_at_once.depth_m = 0.03
    forces_n = [there_at_once.step(STEP_S, -0.1, 0.0)[0] for _ in range(4000)]
    assert softest < measure_shear(ground, GEOMETRY, 0.0, 0.0, 0.03, 0.1) / np.mean(forces_n[2000:]) < firmest


def test_a_load_cell_finds_a_crust_where_it_is() -> None:
    """Down to the bottom of the crust the edge carries 3 times the load, below it the load without a crust.

    The sides stay in the crust.
    A strip that has just come into the mud is loaded within its first millimetre or two: up to 5 % are missing.
    """
    crust = CLAY._replace(layers=(Layer(0.0, 0.01, 3.0),))
    ((z, _, plain_n), _), ((_, _, crusted_n), _) = (strokes(0.03, 0.1, clay=clay) for clay in (CLAY, crust))
    sides_n = 2.0 * CLAY.strength_pa * 0.25 * GIRTH_M * np.clip(z, 0.0, 0.01)
    inside, below = (z > 0.002) & (z < 0.0099), z > 0.0102
    edge_n = 2.0 * CLAY.strength_pa * 5.14 * EDGE_M2
    assert (crusted_n - plain_n)[inside] == pytest.approx(edge_n + sides_n[inside], rel=0.01)
    assert (crusted_n - plain_n)[below] == pytest.approx(sides_n[below], rel=0.05)
