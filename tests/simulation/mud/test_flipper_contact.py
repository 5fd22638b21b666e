"""One flipper in clay: joints and body move its plate, and the transpose of this map gives the loads of the mud."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from simulation.mud.clay import MUDS
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
from simulation.mud.rigid_plate import Wrench, lowest_point_m
from tests.control.test_geometry import rotation

GEOMETRY = FlipperGeometry()
sweeps = st.floats(-0.6, 0.6)
adductions = st.floats(-1.2, 0.3)
speeds = st.floats(-3.0, 3.0)
body_speeds = st.floats(-1.0, 1.0)
POSITIONS_M = [(u, s) for u in (-0.0125, 0.0, 0.0125) for s in (0.0, 0.07)]  # corners and midpoints


def position_m(sweep_rad: float, adduction_rad: float, outward_m: float, above_edge_m: float) -> np.ndarray:
    """Return a point on the plate, relative to the intersection of the axes."""
    along_m = [0.0, GEOMETRY.flipper_length_m + outward_m, above_edge_m - GEOMETRY.drop_m]
    return np.asarray(rotation(sweep_rad, adduction_rad) @ along_m)


@given(sweeps, adductions)
def test_the_attitude_gives_the_depth_of_every_point_of_the_plate(sweep_rad: float, adduction_rad: float) -> None:
    attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad, surface_m=0.004)
    depths_m = [-GEOMETRY.axis_height_m - 0.004 - position_m(sweep_rad, adduction_rad, u, s)[2] for u, s in POSITIONS_M]
    found_m = [attitude.depth_m + attitude.per_outward * u - attitude.per_upward * s for u, s in POSITIONS_M]
    assert found_m == pytest.approx(depths_m)
    assert lowest_point_m(attitude, plate_size(GEOMETRY)) == pytest.approx(max(depths_m))


@given(sweeps, adductions, speeds, speeds, body_speeds)
def test_the_twist_is_the_motion_of_every_point_of_the_plate(
    sweep_rad: float, adduction_rad: float, sweep_rad_s: float, adduction_rad_s: float, body_m_s: float
) -> None:
    twist, moved_s = twist_of(GEOMETRY, ArmMotion(sweep_rad, 0.0, sweep_rad_s, adduction_rad_s, body_m_s)), 1e-6
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
        assert reported_m_s == pytest.approx(velocity_m_s @ rotation(sweep_rad, adduction_rad), abs=1e-8)


@given(sweeps, speeds, speeds, body_speeds, st.tuples(*[st.floats(-10.0, 10.0)] * 7))
def test_torques_and_thrust_do_the_work_that_the_mud_does_on_the_plate(
    sweep_rad: float, sweep_rad_s: float, adduction_rad_s: float, body_m_s: float, parts: tuple[float, ...]
) -> None:
    twist = twist_of(GEOMETRY, ArmMotion(sweep_rad, 0.0, sweep_rad_s, adduction_rad_s, body_m_s))
    force = contact_force(GEOMETRY, sweep_rad, Wrench(*parts))
    power_w = np.dot(force[:3], (sweep_rad_s, adduction_rad_s, body_m_s))
    assert power_w == pytest.approx(np.dot(parts, twist), abs=1e-9)


def held(contact: FlipperContact, sweep_rad: float, depth_m: float) -> ContactForce:
    """Return the force after half a second of a sweep backward with constant angles and depth."""
    adduction_rad, force = GEOMETRY.adduction_rad(sweep_rad, depth_m), NO_CONTACT
    attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad)
    for _ in range(500):
        force = contact.step(0.001, MUDS["48.5"], ArmMotion(sweep_rad, adduction_rad, -1.0), attitude)
    return force


def test_above_the_mud_a_flipper_has_no_load_and_forgets_the_last_one() -> None:
    contact = FlipperContact(GEOMETRY)
    assert held(contact, 0.0, 0.03).normal_n > 1.0
    assert held(contact, 0.0, -0.01) == NO_CONTACT
    still = attitude_of(GEOMETRY, 0.0, GEOMETRY.adduction_rad(0.0, 0.03))
    assert contact.step(0.001, MUDS["48.5"], ArmMotion(0.0, 0.0), still) == pytest.approx(NO_CONTACT)
