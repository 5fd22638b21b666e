"""A stone pushes away from the face that was met, limits the penetration, never pulls and never adds energy."""

from dataclasses import replace
from math import inf

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from simulation.body.free_body import axes_of, own_axes
from simulation.mud.carriage import Carriage, plate_directions
from simulation.mud.flipper_contact import attitude_of, contact_force
from simulation.mud.stones import NO_PUSH, STIFFNESS_N_M, Push, Stone, StoneContact, push_wrench
from simulation.mud.vectors import added, along

DT_S = 0.001
GEOMETRY = FlipperGeometry()
speeds = st.floats(-3.0, 3.0)
STONE = Stone(0.10, 0.16, 0.02)
Path = list[tuple[float, float]]  # positions along the track and depths, each held for two steps so that nothing moves
HALF_MM_N = STIFFNESS_N_M * 0.0005


@pytest.mark.parametrize(
    ("path", "push"),
    [
        ([(0.13, 0.010), (0.13, 0.0205)], (0.0, HALF_MM_N)),  # from above
        ([(0.09, 0.030), (0.1005, 0.030)], (-HALF_MM_N, 0.0)),  # forward, against the flank that faces the start
        ([(0.17, 0.030), (0.1595, 0.030)], (HALF_MM_N, 0.0)),  # backward, like in a stance
        ([(0.1595, 0.03), (0.1595, 0.06)], (HALF_MM_N, 0.0)),  # held at a flank however deep
        ([(0.1595, 0.03), (0.1595, 0.0201)], (HALF_MM_N, 0.0)),  # nearer to the top now
        ([(0.13, 0.0205), (0.1599, 0.0205)], (0.0, HALF_MM_N)),  # slid along the top
        ([(0.13, 0.0205), (0.1601, 0.0205)], NO_PUSH),  # and off over its edge
        ([(0.1595, 0.03), (0.1595, 0.01), (0.13, 0.0205)], (0.0, HALF_MM_N)),  # lifted, and put on the top
        *(([(0.13, 0.03), at], NO_PUSH) for at in ((0.13, 0.02), (0.10, 0.03), (0.16, 0.03), (0.2, 0.05))),
        ([(0.35, 0.0105)], (0.0, HALF_MM_N)),  # the other stone
    ],
)
def test_a_stone_pushes_back_through_the_face_that_the_plate_met(path: Path, push: tuple[float, float]) -> None:
    contact = StoneContact([STONE, Stone(0.3, 0.4, 0.01)])
    pushes = [contact.step(DT_S, *position) for position in path for _ in range(2)]
    assert pushes[-1] == pytest.approx(push)


def test_a_stone_never_pulls_and_a_reset_contact_has_met_none() -> None:
    contact = StoneContact([STONE])
    contact.step(DT_S, 0.13, 0.022)
    assert contact.step(DT_S, 0.13, 0.0201) == NO_PUSH  # away at 1.9 m/s: the damper alone would pull with 28 N
    contact.step(DT_S, 0.1595, 0.03)
    contact.reset()
    assert contact.step(DT_S, 0.13, 0.0205) == StoneContact([STONE]).step(DT_S, 0.13, 0.0205)


@given(st.floats(0.028, 2.0), st.floats(0.01, 3.0), st.floats(0.0, 1.0))
def test_a_mass_that_falls_on_a_stone_rebounds_slower(mass_kg: float, speed_m_s: float, start_fraction: float) -> None:
    """The mass ranges from an arm's sweep inertia at its plate to a body; it arrives at any time within a step."""
    contact, depth_m = StoneContact([STONE]), STONE.top_m - start_fraction * speed_m_s * DT_S
    velocity_m_s, deepest_m = speed_m_s, -inf
    for _ in range(400):
        depth_m += DT_S * velocity_m_s
        velocity_m_s -= DT_S * contact.step(DT_S, 0.13, depth_m).upward_n / mass_kg
        deepest_m = max(deepest_m, depth_m - STONE.top_m)
        if depth_m < STONE.top_m and velocity_m_s < 0.0:  # by rounding, a first step may end just above the stone
            break
    assert depth_m < STONE.top_m
    assert -speed_m_s < velocity_m_s < 0.0
    # At most the depth on a spring without a damper, plus one step.
    assert deepest_m < speed_m_s * ((mass_kg / STIFFNESS_N_M) ** 0.5 + DT_S)


@given(st.floats(-0.6, 0.6), st.floats(-1.2, 0.3), speeds, speeds, speeds, st.floats(-10.0, 10.0), st.floats(0.0, 10.0))
def test_a_push_works_on_the_edge_s_middle_forward_and_on_its_lower_corner_upward(
    sweep_rad: float,
    adduction_rad: float,
    sweep_rad_s: float,
    adduction_rad_s: float,
    body_m_s: float,
    forward_n: float,
    upward_n: float,
) -> None:
    """The reference is virtual work: a point further outward is the middle of the edge of a longer arm."""
    assume(abs(adduction_rad) > 1e-3)  # at a level edge neither corner is the lower one
    attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad)
    wrench = push_wrench(GEOMETRY, sweep_rad, attitude, Push(forward_n, upward_n))
    force = contact_force(GEOMETRY, sweep_rad, wrench)
    power_w = force.sweep_nm * sweep_rad_s + force.adduction_nm * adduction_rad_s + force.thrust_n * body_m_s
    corners = [replace(GEOMETRY, flipper_length_m=0.12 + sign * GEOMETRY.plate_width_m / 2.0) for sign in (1.0, -1.0)]
    lower = min(corners, key=lambda arm: arm.edge_position(sweep_rad, adduction_rad)[2])
    at_middle, at_corner = (arm.jacobian(sweep_rad, adduction_rad) for arm in (GEOMETRY, lower))
    forward_m_s = at_middle.x_sweep * sweep_rad_s + at_middle.x_adduction * adduction_rad_s + body_m_s
    upward_m_s = at_corner.z_sweep * sweep_rad_s + at_corner.z_adduction * adduction_rad_s
    assert power_w == pytest.approx(forward_n * forward_m_s + upward_n * upward_m_s, abs=1e-9)


angles = st.floats(-0.6, 0.6)


@given(angles, angles, angles, angles, st.sampled_from([1.0, -1.0]))
def test_a_stone_pushes_along_the_world_s_directions_a_body_that_rolls_and_pitches(
    sweep_rad: float, adduction_rad: float, roll_rad: float, pitch_rad: float, side: float
) -> None:
    forward, _, up = own_axes(axes_of(roll_rad, pitch_rad), side)
    carriage = Carriage(0.0, up, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    attitude = attitude_of(GEOMETRY, sweep_rad, adduction_rad, carriage=carriage)
    forces_n = push_wrench(GEOMETRY, sweep_rad, attitude, Push(-3.0, 5.0))[:3]
    push_n = added(*map(along, plate_directions(sweep_rad, adduction_rad), forces_n))
    assert push_n == pytest.approx(added(along(forward, -3.0), along(up, 5.0)), abs=1e-9)
