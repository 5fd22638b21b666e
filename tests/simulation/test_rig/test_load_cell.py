"""The virtual load cell agrees with closed forms for upright plates and with the flipper's contact for leaning ones."""

from itertools import pairwise
from math import cos, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from simulation.mud.clay import MUDS, Clay, rate_factor
from simulation.mud.flipper_contact import NO_CONTACT, ArmMotion, FlipperContact, attitude_of
from simulation.mud.layer import Layer
from simulation.test_rig.load_cell import LoadCell, measure_insertion, measure_shear

GEOMETRY = FlipperGeometry()
CLAY = MUDS["48.5"]
EDGE_M2 = GEOMETRY.plate_width_m * GEOMETRY.plate_thickness_m
GIRTH_M = 2.0 * (GEOMETRY.plate_width_m + GEOMETRY.plate_thickness_m)
SWEEPS = st.floats(-0.6, 0.6)
ADDUCTIONS = st.floats(-1.0, 0.0)


def lowered_rad(sweep_rad: float, depth_m: float = 0.03) -> float:
    return GEOMETRY.adduction_rad(sweep_rad, depth_m)


@given(SWEEPS, ADDUCTIONS)
def test_the_axes_are_those_of_the_flipper_s_plate(sweep_rad: float, adduction_rad: float) -> None:
    normal, outward, upward = np.array(LoadCell(CLAY, GEOMETRY, sweep_rad, adduction_rad).axes)
    assert np.cross(normal, outward) == pytest.approx(upward)
    tilt = np.array(
        [[1, 0, 0], [0, cos(adduction_rad), -sin(adduction_rad)], [0, sin(adduction_rad), cos(adduction_rad)]]
    )
    assert normal == pytest.approx(tilt @ [cos(sweep_rad), -sin(sweep_rad), 0.0])
    assert outward == pytest.approx(tilt @ [sin(sweep_rad), cos(sweep_rad), 0.0])
    attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad)
    assert (outward[2], upward[2]) == pytest.approx((-attitude.per_outward, attitude.per_upward))


def test_an_upright_plate_meets_bearing_and_adhesion_while_it_is_lowered() -> None:
    down = measure_insertion(CLAY, GEOMETRY, 0.0, 0.0, 0.04, 0.1).down
    for depth_m, force_n in zip(down.depths_m, down.forces_n, strict=True):
        if depth_m > 0.01:
            limit_n = CLAY.strength_pa * (5.14 * EDGE_M2 + 0.25 * GIRTH_M * depth_m)
            assert force_n == pytest.approx(limit_n, rel=0.03)  # the mud of the last millimetre has not yielded yet


def test_an_upright_plate_meets_suction_and_adhesion_while_it_is_lifted() -> None:
    up = measure_insertion(CLAY, GEOMETRY, 0.0, 0.0, 0.04, 0.1).up
    for depth_m, force_n in zip(up.depths_m, up.forces_n, strict=True):
        if 0.002 < depth_m < 0.035:
            limit_n = CLAY.strength_pa * (9.0 * EDGE_M2 * min(depth_m / 0.01, 1.0) + 0.25 * GIRTH_M * depth_m)
            assert force_n == pytest.approx(-limit_n, rel=0.001)


@pytest.mark.parametrize("sweep_rad", [0.0, 0.5, -0.5])
def test_it_goes_from_the_surface_down_to_the_depth_and_up_until_it_is_out(sweep_rad: float) -> None:
    down, held, up = measure_insertion(CLAY, GEOMETRY, sweep_rad, lowered_rad(sweep_rad), 0.03, 0.1)
    assert down.depths_m[-1] == pytest.approx(0.03)
    assert held.depths_m == ()
    assert all(before < after for before, after in pairwise(down.depths_m))
    assert all(before > after for before, after in pairwise(up.depths_m))
    assert down.forces_n[0] < 0.1 * down.forces_n[-1]
    assert up.forces_n[-1] == pytest.approx(0.0, abs=1e-3)
    assert down.depths_m[1] - down.depths_m[0] == pytest.approx(0.1 * 0.0005, rel=0.01)


@pytest.mark.parametrize("speed_m_s", [0.03, 0.4])
def test_a_faster_insertion_is_harder_by_the_rate_factor(speed_m_s: float) -> None:
    ends_n = [measure_insertion(CLAY, GEOMETRY, 0.0, 0.0, 0.04, speed).down.forces_n[-1] for speed in (0.1, speed_m_s)]
    assert ends_n[1] / ends_n[0] == pytest.approx(rate_factor(speed_m_s), rel=0.02)


def test_a_sweep_to_the_front_and_to_the_back_are_inserted_alike_and_harder_than_an_upright_plate() -> None:
    front, back = (
        measure_insertion(CLAY, GEOMETRY, sweep_rad, lowered_rad(sweep_rad), 0.03, 0.1) for sweep_rad in (0.5, -0.5)
    )
    assert front.down.forces_n == pytest.approx(back.down.forces_n)
    assert front.up.forces_n == pytest.approx(back.up.forces_n)
    assert front.down.forces_n[-1] > 1.2 * measure_insertion(CLAY, GEOMETRY, 0.0, 0.0, 0.03, 0.1).down.forces_n[-1]


def test_a_hold_of_half_a_second_loses_the_stated_fraction() -> None:
    held = measure_insertion(CLAY, GEOMETRY, 0.0, 0.0, 0.03, 0.1, relaxation=0.13, hold_s=3.0).held
    assert len(held.forces_n) == 6000
    assert set(held.depths_m) == {held.depths_m[0]}
    assert held.forces_n[-1] / held.forces_n[0] == pytest.approx(0.87, abs=0.001)
    assert held.forces_n[1000] / held.forces_n[0] == pytest.approx(0.88, abs=0.005)
    steady = measure_insertion(CLAY, GEOMETRY, 0.0, 0.0, 0.03, 0.1, hold_s=3.0).held
    assert steady.forces_n[-1] == pytest.approx(steady.forces_n[0])


@pytest.mark.parametrize("speed_m_s", [0.05, 0.1, 0.5])
def test_an_upright_plate_is_dragged_at_the_limit_of_the_clay(speed_m_s: float) -> None:
    shear_n = measure_shear(CLAY, GEOMETRY, 0.0, 0.0, 0.03, speed_m_s)
    limit_n = rate_factor(speed_m_s) * CLAY.lateral_n(0.03, GEOMETRY.plate_width_m)
    assert shear_n == pytest.approx(limit_n, rel=0.01)


@pytest.mark.parametrize("sweep_rad", [0.0, 0.4, -0.4])
def test_a_body_that_is_pushed_back_drags_its_flipper_with_the_same_force(sweep_rad: float) -> None:
    adduction_rad, force = lowered_rad(sweep_rad), NO_CONTACT
    contact, attitude = FlipperContact(GEOMETRY), attitude_of(GEOMETRY, sweep_rad, adduction_rad)
    for _ in range(1000):
        force = contact.step(0.001, CLAY, ArmMotion(sweep_rad, adduction_rad, body_m_s=-0.1), attitude)
    shear_n = measure_shear(CLAY, GEOMETRY, sweep_rad, adduction_rad, 0.03, 0.1)
    assert force.thrust_n == pytest.approx(shear_n)


def test_the_shear_does_not_depend_on_how_far_it_is_dragged() -> None:
    near_n, far_n = (
        measure_shear(CLAY, GEOMETRY, 0.3, lowered_rad(0.3), 0.03, 0.5, distance_m) for distance_m in (0.06, 0.4)
    )
    assert near_n == pytest.approx(far_n)


def test_a_distance_too_short_for_the_mud_to_yield_is_refused() -> None:
    with pytest.raises(ValueError, match="distance_m"):
        measure_shear(CLAY, GEOMETRY, 0.0, 0.0, 0.03, 0.5, distance_m=0.02)


def test_twice_the_strength_is_a_bit_less_than_twice_the_shear() -> None:
    """Part of the pressure comes from the weight of the mud, which does not depend on its strength."""
    weak_n, strong_n = (
        measure_shear(Clay("any", strength_pa), GEOMETRY, 0.0, radians(-20.0), 0.03, 0.1)
        for strength_pa in (2000.0, 4000.0)
    )
    assert 1.5 < strong_n / weak_n < 1.99


def test_a_load_cell_finds_a_crust_where_it_is() -> None:
    """Down to the bottom of the crust the edge carries 3 times the load, below it the load without a crust.

    The sides stay in the crust.
    A strip that has just come into the mud is loaded within its first millimetre or two: up to 5 % are missing.
    """
    plain = measure_insertion(CLAY, GEOMETRY, 0.0, 0.0, 0.03, 0.1).down
    crusted = measure_insertion(CLAY._replace(layers=(Layer(0.0, 0.01, 3.0),)), GEOMETRY, 0.0, 0.0, 0.03, 0.1).down
    for depth_m, forces_n, plain_n in zip(crusted.depths_m, crusted.forces_n, plain.forces_n, strict=True):
        added_n = 2.0 * CLAY.strength_pa * 0.25 * GIRTH_M * min(max(depth_m, 0.0), 0.01)
        if 0.002 < depth_m < 0.0099:  # beyond the millimetre in which it yields
            assert forces_n - plain_n == pytest.approx(2.0 * CLAY.strength_pa * 5.14 * EDGE_M2 + added_n, rel=0.01)
        elif depth_m > 0.0102:
            assert forces_n - plain_n == pytest.approx(added_n, rel=0.05)


def test_a_reset_cell_is_a_new_one() -> None:
    cell = LoadCell(CLAY, GEOMETRY, 0.3, lowered_rad(0.3), relaxation=0.1)
    first = cell.lower(0.03, 0.1)
    cell.hold(1.0)
    cell.reset()
    assert cell.lower(0.03, 0.1) == first
