"""A stone pushes away from the face that was met, limits the penetration, never pulls and never adds energy."""

from dataclasses import replace
from math import inf

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from simulation.mud.flipper_contact import contact_force
from simulation.mud.stones import NO_PUSH, STIFFNESS_N_M, Push, Stone, StoneContact, push_wrench

DT_S = 0.001
GEOMETRY = FlipperGeometry()
SPEEDS = st.floats(-3.0, 3.0)
STONE = Stone(0.10, 0.16, 0.02)


def pushed(*path: tuple[float, float]) -> tuple[float, float]:
    """Return the push at the last of these (position, depth), each held for two steps so that nothing moves."""
    contact, push = StoneContact([STONE]), NO_PUSH
    for position_m, depth_m in path:
        for _ in range(2):
            push = contact.step(DT_S, position_m, depth_m)
    return push


@pytest.mark.parametrize(
    ("path", "forward", "upward"),
    [
        ([(0.13, 0.010), (0.13, 0.0205)], 0.0, 1.0),  # from above
        ([(0.09, 0.030), (0.1005, 0.030)], -1.0, 0.0),  # forward, against the flank that faces the start
        ([(0.17, 0.030), (0.1595, 0.030)], 1.0, 0.0),  # backward, like in a stance
    ],
)
def test_a_stone_pushes_back_where_the_plate_came_from(
    path: list[tuple[float, float]], forward: float, upward: float
) -> None:
    force_n = STIFFNESS_N_M * 0.0005
    assert pushed(*path) == pytest.approx((forward * force_n, upward * force_n))


@pytest.mark.parametrize("position", [(0.13, 0.02), (0.13, 0.0), (0.10, 0.03), (0.16, 0.03), (0.2, 0.05)])
def test_next_to_and_above_a_stone_there_is_no_push(position: tuple[float, float]) -> None:
    assert pushed((0.13, 0.03), position) == (0.0, 0.0)


def test_a_plate_at_a_flank_slides_along_it_and_is_held_there_however_deep_it_is() -> None:
    force_n = STIFFNESS_N_M * 0.0005
    assert pushed((0.1595, 0.03), (0.1595, 0.06)) == pytest.approx((force_n, 0.0))
    assert pushed((0.1595, 0.03), (0.1595, 0.0201)) == pytest.approx((force_n, 0.0))  # now it is nearer to the top


def test_a_plate_on_top_slides_off_over_the_edge() -> None:
    assert pushed((0.13, 0.0205), (0.1599, 0.0205)) == pytest.approx((0.0, STIFFNESS_N_M * 0.0005))
    assert pushed((0.13, 0.0205), (0.1601, 0.0205)) == (0.0, 0.0)


def test_a_plate_that_is_lifted_and_put_down_again_meets_the_face_that_it_then_comes_to() -> None:
    _, upward_n = pushed((0.1595, 0.03), (0.1595, 0.01), (0.13, 0.01), (0.13, 0.0205))
    assert upward_n > 0.0


def test_of_several_stones_the_one_at_the_plate_counts() -> None:
    contact = StoneContact([STONE, Stone(0.3, 0.4, 0.01)])
    assert contact.step(DT_S, 0.35, 0.0105).upward_n > 0.0
    assert contact.step(DT_S, 0.25, 0.0105) == (0.0, 0.0)


def test_a_stone_never_pulls() -> None:
    contact = StoneContact([STONE])
    contact.step(DT_S, 0.13, 0.022)
    assert contact.step(DT_S, 0.13, 0.0201) == (0.0, 0.0)  # away at 1.9 m/s: the damper alone would pull with 28 N


def test_a_reset_contact_has_met_no_stone() -> None:
    contact = StoneContact([STONE])
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


@pytest.mark.parametrize("load_n", [1.0, 6.25, 14.0])
def test_a_plate_that_is_pressed_on_a_stone_comes_to_rest_within_a_millimetre_of_its_top(load_n: float) -> None:
    contact, depth_m, velocity_m_s = StoneContact([STONE]), STONE.top_m, 0.1
    for _ in range(1000):
        depth_m += DT_S * velocity_m_s
        velocity_m_s += DT_S * (load_n - contact.step(DT_S, 0.13, depth_m).upward_n) / 0.042
    assert depth_m - STONE.top_m == pytest.approx(load_n / STIFFNESS_N_M)
    assert depth_m - STONE.top_m < 0.001
    assert velocity_m_s == pytest.approx(0.0, abs=1e-6)


@given(st.floats(-0.6, 0.6), st.floats(-1.2, 0.3), SPEEDS, SPEEDS, SPEEDS, st.floats(-10.0, 10.0), st.floats(0.0, 10.0))
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
    wrench = push_wrench(GEOMETRY, sweep_rad, adduction_rad, Push(forward_n, upward_n))
    force = contact_force(GEOMETRY, sweep_rad, wrench)
    power_w = force.sweep_nm * sweep_rad_s + force.adduction_nm * adduction_rad_s + force.thrust_n * body_m_s

    def height_m(arm: FlipperGeometry) -> float:
        return arm.edge_position(sweep_rad, adduction_rad)[2]

    corners = (replace(GEOMETRY, flipper_length_m=0.12 + sign * GEOMETRY.plate_width_m / 2.0) for sign in (1.0, -1.0))
    lower = min(corners, key=height_m)
    at_middle, at_corner = (arm.jacobian(sweep_rad, adduction_rad) for arm in (GEOMETRY, lower))
    forward_m_s = at_middle.x_sweep * sweep_rad_s + at_middle.x_adduction * adduction_rad_s + body_m_s
    upward_m_s = at_corner.z_sweep * sweep_rad_s + at_corner.z_adduction * adduction_rad_s
    assert power_w == pytest.approx(forward_n * forward_m_s + upward_n * upward_m_s, abs=1e-9)
