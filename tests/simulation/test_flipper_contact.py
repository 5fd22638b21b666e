"""One flipper in clay: yields where the clay does, holds at rest, gives no energy, and its torques are its forces."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from simulation.clay import MUDS, rate_factor
from simulation.flipper_contact import NO_CONTACT, ContactForce, FlipperContact

GEOMETRY = FlipperGeometry()
CLAY = MUDS["48.5"]
DT_S = 0.001
SWEEPS = st.floats(-0.6, 0.6)
DEPTHS = st.floats(0.005, 0.045)
SPEEDS = st.floats(-3.0, 3.0)


def in_world(adduction_rad: float, x: float, y: float, z: float) -> np.ndarray:
    """A vector of the frame that tilts with adduction, in the world's frame: x forward, y outward, z up."""
    sb, cb = sin(adduction_rad), cos(adduction_rad)
    return np.array([x, cb * y - sb * z, sb * y + cb * z])


def place_m(sweep_rad: float, adduction_rad: float, below_arm_m: float) -> np.ndarray:
    """Of the point `below_arm_m` under the arm's end."""
    length_m = GEOMETRY.flipper_length_m
    return in_world(adduction_rad, length_m * sin(sweep_rad), length_m * cos(sweep_rad), -below_arm_m)


def hold(
    contact: FlipperContact, sweep_rad: float, depth_m: float, velocities: tuple[float, float, float], seconds: float
) -> ContactForce:
    """The force after moving at these velocities (sweep, adduction, body); the angles stay, and with them the depth."""
    adduction_rad = GEOMETRY.adduction_rad(sweep_rad, depth_m)
    force = NO_CONTACT
    for _ in range(round(seconds / DT_S)):
        force = contact.step(DT_S, CLAY, sweep_rad, adduction_rad, *velocities)
    return force


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_plate_yields_sideways_at_the_limit_of_the_clay(direction: float) -> None:
    sweep_rad_s = direction * 0.1 / GEOMETRY.flipper_length_m
    force = hold(FlipperContact(GEOMETRY), 0.0, 0.03, (sweep_rad_s, 0.0, 0.0), 1.0)
    limit_n = CLAY.lateral_n(0.03, GEOMETRY.plate_width_m)
    assert force.normal_n == pytest.approx(-direction * limit_n)
    assert force.thrust_n == pytest.approx(-direction * limit_n)  # a flipper that sweeps back pushes the body forward
    assert force.sweep_nm == pytest.approx(-direction * limit_n * GEOMETRY.flipper_length_m)
    assert force.upward_n == 0.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_plate_yields_in_insertion_and_extraction_at_the_limits_of_the_clay(direction: float) -> None:
    contact, depth_m = FlipperContact(GEOMETRY), 0.005  # where the two limits differ
    above_edge_m = depth_m - CLAY.lateral_center_m(depth_m, GEOMETRY.plate_width_m)
    below_arm_m = GEOMETRY.drop_m - above_edge_m / cos(GEOMETRY.adduction_rad(0.0, depth_m))
    speed_per_rad_s = np.hypot(GEOMETRY.flipper_length_m, below_arm_m)
    force = hold(contact, 0.0, depth_m, (0.0, direction * 0.1 / speed_per_rad_s, 0.0), 1.0)
    law = CLAY.extraction_n if direction > 0.0 else CLAY.insertion_n
    limit_n = law(depth_m, contact.plate)
    assert force.upward_n == pytest.approx(-direction * limit_n)


def test_a_loaded_plate_at_rest_does_not_creep() -> None:
    contact = FlipperContact(GEOMETRY)
    hold(contact, 0.3, 0.03, (-1.0, 0.2, 0.05), 0.5)
    at_rest = hold(contact, 0.3, 0.03, (0.0, 0.0, 0.0), DT_S)
    after_a_minute = hold(contact, 0.3, 0.03, (0.0, 0.0, 0.0), 60.0)
    assert after_a_minute == pytest.approx(at_rest, rel=1e-9)
    static_n = rate_factor(0.0) * CLAY.lateral_n(0.03, GEOMETRY.plate_width_m)
    assert at_rest.normal_n == pytest.approx(static_n)


def test_a_small_push_springs_back() -> None:
    contact = FlipperContact(GEOMETRY)
    pushed = hold(contact, 0.0, 0.03, (0.2, 0.0, 0.0), 0.01)
    assert pushed.normal_n < -0.1
    back = hold(contact, 0.0, 0.03, (-0.2, 0.0, 0.0), 0.01)
    assert back.normal_n == pytest.approx(0.0, abs=1e-9)


@given(SWEEPS, DEPTHS, SPEEDS, SPEEDS, st.floats(-1.0, 1.0))
def test_torques_and_thrust_are_the_force_by_virtual_work(
    sweep_rad: float, depth_m: float, sweep_rad_s: float, adduction_rad_s: float, body_m_s: float
) -> None:
    assume(abs(sweep_rad) > 0.05)  # else thrust does not tell the outward force, which the record leaves out
    force = hold(FlipperContact(GEOMETRY), sweep_rad, depth_m, (sweep_rad_s, adduction_rad_s, body_m_s), 0.005)
    adduction_rad = GEOMETRY.adduction_rad(sweep_rad, depth_m)
    outward_n = (force.thrust_n - force.normal_n * cos(sweep_rad)) / sin(sweep_rad)
    world_n = (
        force.normal_n * in_world(adduction_rad, cos(sweep_rad), -sin(sweep_rad), 0.0)
        + outward_n * in_world(adduction_rad, sin(sweep_rad), cos(sweep_rad), 0.0)
        + force.upward_n * in_world(adduction_rad, 0.0, 0.0, 1.0)
    )
    above_edge_m = depth_m - CLAY.lateral_center_m(depth_m, GEOMETRY.plate_width_m)
    below_arm_m = GEOMETRY.drop_m - above_edge_m / cos(adduction_rad)
    moved_s = 1e-6
    ahead_m, behind_m = (
        place_m(sweep_rad + sign * sweep_rad_s * moved_s, adduction_rad + sign * adduction_rad_s * moved_s, below_arm_m)
        for sign in (1.0, -1.0)
    )
    velocity_m_s = (ahead_m - behind_m) / (2.0 * moved_s) + np.array([body_m_s, 0.0, 0.0])
    power_w = force.sweep_nm * sweep_rad_s + force.adduction_nm * adduction_rad_s + force.thrust_n * body_m_s
    assert power_w == pytest.approx(float(world_n @ velocity_m_s), rel=1e-6, abs=1e-6)


@given(st.integers(1, 3), st.floats(0.1, 0.6), st.floats(0.0, 2.0 * pi), st.floats(0.0, 0.05))
def test_a_closed_cycle_of_motion_takes_energy_and_never_gives_any(
    rounds: int, sweep_amplitude_rad: float, shift_rad: float, body_amplitude_m: float
) -> None:
    contact, work_j, dt_s = FlipperContact(GEOMETRY), 0.0, 0.0005
    rate_rad_s = 2.0 * pi
    middle_rad = GEOMETRY.adduction_rad(0.0, 0.005)
    for step in range(rounds * 2000):
        angle = rate_rad_s * (step + 1) * dt_s
        sweep_rad_s = rate_rad_s * sweep_amplitude_rad * cos(angle)
        adduction_rad_s = -rate_rad_s * 0.2 * sin(angle + shift_rad)
        body_m_s = rate_rad_s * body_amplitude_m * cos(angle)
        force = contact.step(
            dt_s,
            CLAY,
            sweep_amplitude_rad * sin(angle),
            middle_rad + 0.2 * cos(angle + shift_rad),
            sweep_rad_s,
            adduction_rad_s,
            body_m_s,
        )
        power_w = force.sweep_nm * sweep_rad_s + force.adduction_nm * adduction_rad_s + force.thrust_n * body_m_s
        work_j += power_w * dt_s
    assert work_j < -0.001 * rounds


def test_there_is_no_force_above_the_mud_and_the_memory_is_lost_there() -> None:
    contact = FlipperContact(GEOMETRY)
    held = hold(contact, 0.0, 0.03, (0.5, 0.0, 0.0), 0.1)
    assert held.normal_n < 0.0
    assert contact.step(DT_S, CLAY, 0.0, 0.0, 1.0, 1.0, 1.0) == NO_CONTACT
    assert hold(contact, 0.0, 0.03, (0.0, 0.0, 0.0), DT_S) == pytest.approx(NO_CONTACT)
