"""One flipper in clay: joints and body move its plate, and the transpose of this map gives the loads of the mud."""

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from simulation.mud.clay import MUDS, rate_factor
from simulation.mud.flipper_contact import (
    NO_CONTACT,
    ArmMotion,
    ContactForce,
    FlipperContact,
    attitude_of,
    contact_force,
    plate_size,
    twist_of,
)
from simulation.mud.rigid_plate import PlateSize, Wrench, lowest_point_m

GEOMETRY = FlipperGeometry()
CLAY = MUDS["48.5"]
DT_S = 0.001
SWEEPS = st.floats(-0.6, 0.6)
ADDUCTIONS = st.floats(-1.2, 0.3)
DEPTHS = st.floats(0.005, 0.045)
SPEEDS = st.floats(-3.0, 3.0)
POSITIONS_M = [(u, s) for u in (-0.0125, 0.0, 0.0125) for s in (0.0, 0.07)]  # corners and midpoints


def in_world(adduction_rad: float, x: float, y: float, z: float) -> np.ndarray:
    """Return a vector of the frame that tilts with adduction in the world's frame: x forward, y outward, z up."""
    sb, cb = sin(adduction_rad), cos(adduction_rad)
    return np.array([x, cb * y - sb * z, sb * y + cb * z])


def position_m(sweep_rad: float, adduction_rad: float, outward_m: float, above_edge_m: float) -> np.ndarray:
    """Return a point on the plate, relative to the intersection of the axes."""
    arm_m = GEOMETRY.flipper_length_m + outward_m
    return in_world(adduction_rad, arm_m * sin(sweep_rad), arm_m * cos(sweep_rad), above_edge_m - GEOMETRY.drop_m)


def hold(
    contact: FlipperContact,
    sweep_rad: float,
    depth_m: float,
    velocities: tuple[float, float, float],
    seconds: float,
    surface_m: float = 0.0,
) -> ContactForce:
    """Return the force after a motion at these velocities (sweep, adduction, body) with constant angles and depth."""
    adduction_rad = GEOMETRY.adduction_rad(sweep_rad, depth_m)
    force = NO_CONTACT
    for _ in range(round(seconds / DT_S)):
        attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad, surface_m)
        force = contact.step(DT_S, CLAY, ArmMotion(sweep_rad, adduction_rad, *velocities), attitude)
    return force


@given(SWEEPS, ADDUCTIONS)
def test_the_attitude_gives_the_depth_of_every_point_of_the_plate(sweep_rad: float, adduction_rad: float) -> None:
    attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad, surface_m=0.004)
    for u, s in POSITIONS_M:
        depth_m = -GEOMETRY.axis_height_m - 0.004 - position_m(sweep_rad, adduction_rad, u, s)[2]
        assert attitude.depth_m + attitude.per_outward * u - attitude.per_upward * s == pytest.approx(depth_m)


@given(SWEEPS, ADDUCTIONS)
def test_the_lowest_point_is_the_lower_one_of_the_two_lower_corners(sweep_rad: float, adduction_rad: float) -> None:
    corners_m = [position_m(sweep_rad, adduction_rad, u, 0.0)[2] for u in (-0.0125, 0.0125)]
    lowest = lowest_point_m(attitude_of(GEOMETRY, sweep_rad, adduction_rad), plate_size(GEOMETRY))
    assert lowest == pytest.approx(-GEOMETRY.axis_height_m - min(corners_m))


@given(SWEEPS, ADDUCTIONS, SPEEDS, SPEEDS, st.floats(-1.0, 1.0))
def test_the_twist_is_the_motion_of_every_point_of_the_plate(
    sweep_rad: float, adduction_rad: float, sweep_rad_s: float, adduction_rad_s: float, body_m_s: float
) -> None:
    twist, moved_s = twist_of(GEOMETRY, ArmMotion(sweep_rad, 0.0, sweep_rad_s, adduction_rad_s, body_m_s)), 1e-6
    directions = (
        in_world(adduction_rad, cos(sweep_rad), -sin(sweep_rad), 0.0),
        in_world(adduction_rad, sin(sweep_rad), cos(sweep_rad), 0.0),
        in_world(adduction_rad, 0.0, 0.0, 1.0),
    )
    for u, s in POSITIONS_M:
        after_m, before_m = (
            position_m(sweep_rad + sign * sweep_rad_s * moved_s, adduction_rad + sign * adduction_rad_s * moved_s, u, s)
            for sign in (1.0, -1.0)
        )
        velocity_m_s = (after_m - before_m) / (2.0 * moved_s) + np.array([body_m_s, 0.0, 0.0])
        reported_m_s = (
            twist.normal_m_s + twist.normal_per_outward_s * u + twist.normal_per_upward_s * s,
            twist.outward_m_s + twist.outward_per_upward_s * s,
            twist.upward_m_s + twist.upward_per_outward_s * u,
        )
        assert reported_m_s == pytest.approx([float(velocity_m_s @ axis) for axis in directions], abs=1e-8)


@given(SWEEPS, SPEEDS, SPEEDS, st.floats(-1.0, 1.0), st.tuples(*[st.floats(-10.0, 10.0)] * 7))
def test_torques_and_thrust_do_the_work_that_the_mud_does_on_the_plate(
    sweep_rad: float, sweep_rad_s: float, adduction_rad_s: float, body_m_s: float, parts: tuple[float, ...]
) -> None:
    wrench, twist = (
        Wrench(*parts),
        twist_of(GEOMETRY, ArmMotion(sweep_rad, 0.0, sweep_rad_s, adduction_rad_s, body_m_s)),
    )
    force = contact_force(GEOMETRY, sweep_rad, wrench)
    power_w = force.sweep_nm * sweep_rad_s + force.adduction_nm * adduction_rad_s + force.thrust_n * body_m_s
    assert power_w == pytest.approx(sum(a * b for a, b in zip(wrench, twist, strict=True)), abs=1e-9)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_plate_yields_sideways_at_the_limit_of_the_clay(direction: float) -> None:
    sweep_rad_s = direction * 0.1 / GEOMETRY.flipper_length_m
    force = hold(FlipperContact(GEOMETRY), 0.0, 0.03, (sweep_rad_s, 0.0, 0.0), 1.0)
    # The plate leans with the arm, so more of it is in the mud than of an upright plate.
    limit_n = CLAY.lateral_n(0.03, GEOMETRY.plate_width_m) / cos(GEOMETRY.adduction_rad(0.0, 0.03))
    assert force.normal_n == pytest.approx(-direction * limit_n, rel=0.015)  # the lean makes one end deeper than 3 cm
    assert force.thrust_n == pytest.approx(force.normal_n)  # a flipper that sweeps back pushes the body forward
    assert force.sweep_nm == pytest.approx(force.normal_n * GEOMETRY.flipper_length_m, rel=0.02)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_mud_pushes_an_inserted_flipper_up_and_an_extracted_one_down(direction: float) -> None:
    force = hold(FlipperContact(GEOMETRY), 0.0, 0.02, (0.0, 0.5 * direction, 0.0), 1.0)
    assert direction * force.upward_n < -0.5
    assert direction * force.adduction_nm < -0.05


def test_a_load_across_the_face_turns_the_adduction_joint_by_its_lever_below_the_arm() -> None:
    """The authors' stances show this cross-coupling: -e sin α times the normal force, at a depth e below the arm."""
    for sweep_rad in (0.4, -0.4):
        force = hold(FlipperContact(GEOMETRY), sweep_rad, 0.03, (-1.0, 0.0, 0.0), 0.5)
        lever_m = force.adduction_nm / (-sin(sweep_rad) * force.normal_n)
        assert 0.5 * GEOMETRY.drop_m < lever_m < GEOMETRY.drop_m
        assert abs(force.outward_n) + abs(force.upward_n) < 1e-9


def test_a_loaded_plate_at_rest_does_not_creep() -> None:
    contact = FlipperContact(GEOMETRY)
    moving = hold(contact, 0.3, 0.03, (-1.0, 0.0, 0.05), 0.5)
    at_rest = hold(contact, 0.3, 0.03, (0.0, 0.0, 0.0), DT_S)
    assert hold(contact, 0.3, 0.03, (0.0, 0.0, 0.0), 5.0) == pytest.approx(at_rest, rel=1e-9)
    speed_m_s = hypot(0.12 - 0.05 * cos(0.3), 0.05 * sin(0.3))
    assert at_rest.normal_n == pytest.approx(rate_factor(0.0) / rate_factor(speed_m_s) * moving.normal_n)


def test_a_relaxing_plate_at_rest_loses_the_stated_fraction() -> None:
    contact = FlipperContact(GEOMETRY, relaxation=0.3)
    hold(contact, 0.3, 0.03, (-1.0, 0.0, 0.0), 0.5)
    at_rest = hold(contact, 0.3, 0.03, (0.0, 0.0, 0.0), DT_S)
    relaxed = hold(contact, 0.3, 0.03, (0.0, 0.0, 0.0), 5.0)
    assert relaxed.sweep_nm / at_rest.sweep_nm == pytest.approx(0.7, abs=0.002)


@settings(max_examples=30)
@given(st.integers(1, 3), st.floats(0.1, 0.6), st.floats(0.0, 2.0 * pi), st.floats(0.0, 0.05), st.floats(0.0, 0.05))
def test_a_closed_cycle_of_motion_takes_energy_and_never_returns_more_than_it_took(
    rounds: int, sweep_amplitude_rad: float, shift_rad: float, body_amplitude_m: float, middle_depth_m: float
) -> None:
    contact, given_j, dt_s = FlipperContact(GEOMETRY), 0.0, 0.0005
    rate_rad_s = 2.0 * pi
    middle_rad = GEOMETRY.adduction_rad(0.0, middle_depth_m)
    for step in range(rounds * 2000):
        angle = rate_rad_s * (step + 1) * dt_s
        sweep_rad_s = rate_rad_s * sweep_amplitude_rad * cos(angle)
        adduction_rad_s = -rate_rad_s * 0.2 * sin(angle + shift_rad)
        body_m_s = rate_rad_s * body_amplitude_m * cos(angle)
        angles_rad = sweep_amplitude_rad * sin(angle), middle_rad + 0.2 * cos(angle + shift_rad)
        motion = ArmMotion(*angles_rad, sweep_rad_s, adduction_rad_s, body_m_s)
        force = contact.step(dt_s, CLAY, motion, attitude_of(GEOMETRY, *angles_rad))
        power_w = force.sweep_nm * sweep_rad_s + force.adduction_nm * adduction_rad_s + force.thrust_n * body_m_s
        given_j += power_w * dt_s
        assert given_j < 1e-9
    assert given_j < -0.001 * rounds


def test_a_lower_surface_is_like_a_flipper_held_higher() -> None:
    lower = hold(FlipperContact(GEOMETRY), 0.0, 0.03, (0.5, 0.0, 0.0), 0.5, surface_m=0.01)
    nominal = hold(FlipperContact(GEOMETRY), 0.0, 0.03, (0.5, 0.0, 0.0), 0.5)
    higher = hold(FlipperContact(GEOMETRY), 0.0, 0.02, (0.5, 0.0, 0.0), 0.5)
    assert lower.normal_n == pytest.approx(higher.normal_n, rel=0.1)  # the arm hangs lower, so the plate leans more
    assert abs(lower.normal_n) < 0.7 * abs(nominal.normal_n)
    clear = hold(FlipperContact(GEOMETRY), 0.0, 0.03, (0.5, 0.0, 0.0), 0.5, surface_m=0.04)
    assert clear == NO_CONTACT


def test_there_is_no_force_above_the_mud_and_the_memory_is_lost_there() -> None:
    contact = FlipperContact(GEOMETRY)
    held = hold(contact, 0.0, 0.03, (0.5, 0.0, 0.0), 0.1)
    assert held.normal_n < 0.0
    above = attitude_of(GEOMETRY, 0.0, 0.0)
    assert contact.step(DT_S, CLAY, ArmMotion(0.0, 0.0, 1.0, 1.0, 1.0), above) == NO_CONTACT
    assert hold(contact, 0.0, 0.03, (0.0, 0.0, 0.0), DT_S) == pytest.approx(NO_CONTACT)


def test_a_reset_contact_is_a_new_one() -> None:
    contact = FlipperContact(GEOMETRY)
    hold(contact, 0.0, 0.03, (0.5, 0.2, 0.1), 0.1)
    contact.reset()
    motion = (0.05, 0.02, 0.01)
    assert hold(contact, 0.0, 0.03, motion, 0.05) == hold(FlipperContact(GEOMETRY), 0.0, 0.03, motion, 0.05)


def test_the_plate_is_the_one_of_the_geometry() -> None:
    size = plate_size(FlipperGeometry(plate_width_m=0.03, plate_height_m=0.06, plate_thickness_m=0.005))
    assert size == PlateSize(0.03, 0.06, 0.005)
