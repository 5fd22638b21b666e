"""The free body agrees with rotation matrices, with finite differences, and with the laws of mechanics."""

from dataclasses import replace
from math import cos, hypot, pi, sin
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.controller import WalkOrder
from control.geometry import FlipperGeometry
from control.records import Joints
from firmware_host.configuration.configuration import Configuration
from simulation.body.free_body import (
    YIELD_M,
    Axes,
    BellyQuarter,
    BodyShape,
    FreeBody,
    axes_of,
    in_world,
    load_at,
    load_of_flipper,
)
from simulation.body.plant import STEP_S, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.body.rail_body import DragPad
from simulation.harness.lockstep import Lockstep, plant_of
from simulation.mud.carriage import LEAST_UPRIGHT, carried_attitude, carried_twist
from simulation.mud.clay import MUDS, Clay, rate_factor
from simulation.mud.flipper_contact import NO_CONTACT, ArmMotion, ContactForce, attitude_of, contact_force, twist_of
from simulation.mud.rigid_plate import Wrench
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE
from tests.copied_robots import copy_of

GEOMETRY, SHAPE, MASS_KG = FlipperGeometry(), BodyShape(), 1.02
AHEAD_M = 0.02  # the joints are ahead of the centre of mass, where geometry is tested
AREA_M2 = SHAPE.length_m * SHAPE.width_m
WEIGHT_N = MASS_KG * 9.81
NO_PAD = DragPad(0.0, 0.0)
FREE = PlantParameters(free_body=True)
POSITIONS_M = [(u, s) for u in (-0.0125, 0.0, 0.0125) for s in (0.0, 0.07)]  # corners and midpoints
TURNS = st.floats(-0.6, 0.6)
RATES = st.floats(-3.0, 3.0)
SIDES = st.sampled_from([1.0, -1.0])


class Still:
    """A flipper with a constant force of the mud, or none."""

    sweep_rad = adduction_rad = 0.0

    def __init__(self, force: ContactForce = NO_CONTACT) -> None:
        self.force = force


def make_body(clay: Clay = MUDS["48.5"], pad: DragPad = NO_PAD, mass_kg: float = MASS_KG) -> FreeBody:
    return FreeBody(mass_kg, SHAPE, pad, Track([(9.0, clay)]))


def live(body: FreeBody, seconds: float, left: Still | None = None, right: Still | None = None) -> None:
    for _ in range(round(seconds / STEP_S)):
        body.step(STEP_S, left or Still(), right or Still())


def turned(roll_rad: float, pitch_rad: float) -> np.ndarray:
    """Return the textbook rotation from the body's axes to the world's."""
    sr, cr, sp, cp = np.sin(roll_rad), np.cos(roll_rad), np.sin(pitch_rad), np.cos(pitch_rad)
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    rotation: np.ndarray = about_y @ about_x
    return rotation


def plate_in_body(sweep_rad: float, adduction_rad: float, side: float) -> np.ndarray:
    """Return as columns the plate's axes n, r and s and the intersection of the joints' axes; y is to the left."""
    ca, sa = np.cos(sweep_rad), np.sin(sweep_rad)
    tilted = turned(adduction_rad, 0.0) @ np.array([[ca, sa, 0.0], [-sa, ca, 0.0], [0.0, 0.0, 1.0]])
    cross_coupling = np.array([[AHEAD_M], [SHAPE.width_m / 2.0], [0.0]])
    plate: np.ndarray = np.diag([1.0, side, 1.0]) @ np.hstack([tilted, cross_coupling])
    return plate


def point_in_world(state: np.ndarray, side: float, u: float, s: float) -> np.ndarray:
    """Return the point (u, s) of the plate; `state` is forward, height, roll, pitch, sweep, adduction."""
    forward_m, height_m, roll_rad, pitch_rad, sweep_rad, adduction_rad = state
    plate = plate_in_body(sweep_rad, adduction_rad, side)
    along = np.array([0.0, GEOMETRY.flipper_length_m + u, s - GEOMETRY.drop_m, 1.0])
    position_m: np.ndarray = np.array([forward_m, 0.0, height_m]) + turned(roll_rad, pitch_rad) @ plate @ along
    return position_m


def body_in(state: np.ndarray, rates: np.ndarray) -> FreeBody:
    body = FreeBody(MASS_KG, BodyShape(axis_forward_m=AHEAD_M), NO_PAD, Track([(9.0, MUDS["48.5"])]))
    body.forward_m, body.height_m, body.roll_rad, body.pitch_rad = state[:4]
    body.forward_m_s, body.upward_m_s, body.roll_rad_s, body.pitch_rad_s = rates[:4]
    return body


STATES = st.tuples(st.floats(-1.0, 1.0), st.floats(0.0, 0.1), TURNS, TURNS, TURNS, st.floats(-0.8, 0.3)).map(np.array)
SPEEDS = st.tuples(*[RATES] * 6).map(np.array)


@given(STATES, SIDES)
def test_a_carried_plate_has_the_depth_of_rotation_matrices(state: np.ndarray, side: float) -> None:
    carriage = body_in(state, np.zeros(6)).carriages[side < 0.0]
    attitude = carried_attitude(GEOMETRY, carriage, state[4], state[5], 0.004)
    if attitude.per_upward == LEAST_UPRIGHT:  # a plate that lies flat is limited by the model
        return
    for u, s in POSITIONS_M:
        reported_m = attitude.depth_m + attitude.per_outward * u - attitude.per_upward * s
        assert reported_m == pytest.approx(-point_in_world(state, side, u, s)[2] - 0.004)


def test_a_plate_on_a_tipped_body_never_lies_flat() -> None:
    body = make_body()
    body.roll_rad = 1.5
    left, right = (carried_attitude(GEOMETRY, carriage, 0.0, 0.5, 0.0) for carriage in body.carriages)
    assert left.per_upward == LEAST_UPRIGHT
    assert right.per_upward == pytest.approx(cos(1.0))


@given(STATES, SPEEDS, SIDES)
def test_a_carried_plate_moves_by_the_differences_of_its_positions(
    state: np.ndarray, rates: np.ndarray, side: float
) -> None:
    twist = carried_twist(GEOMETRY, body_in(state, rates).carriages[side < 0.0], *state[4:], *rates[4:])
    plate, moved_s = turned(*state[2:4]) @ plate_in_body(state[4], state[5], side), 1e-6
    for u, s in POSITIONS_M:
        after_m, before_m = (point_in_world(state + sign * moved_s * rates, side, u, s) for sign in (1.0, -1.0))
        velocity_m_s = (after_m - before_m) / (2.0 * moved_s)
        reported_m_s = (
            twist.normal_m_s + twist.normal_per_outward_s * u + twist.normal_per_upward_s * s,
            twist.outward_m_s + twist.outward_per_upward_s * s,
            twist.upward_m_s + twist.upward_per_outward_s * u,
        )
        assert reported_m_s == pytest.approx([float(velocity_m_s @ plate[:, axis]) for axis in range(3)], abs=1e-7)


@given(STATES, SPEEDS, SIDES, st.tuples(*[st.floats(-10.0, 10.0)] * 7))
def test_joints_and_body_get_the_work_that_the_mud_does_on_a_carried_plate(
    state: np.ndarray, rates: np.ndarray, side: float, parts: tuple[float, ...]
) -> None:
    wrench, body = Wrench(*parts), body_in(state, rates)
    force = contact_force(GEOMETRY, state[4], wrench)
    flipper, other = Still(force), Still()
    flipper.sweep_rad, flipper.adduction_rad = state[4:]
    pair = (flipper, other) if side > 0.0 else (other, flipper)
    (load,) = body.flipper_loads(axes_of(state[2], state[3]), *pair)
    twist = carried_twist(GEOMETRY, body.carriages[side < 0.0], *state[4:], *rates[4:])
    power_w = float(np.dot(load, rates[:4])) + force.sweep_nm * rates[4] + force.adduction_nm * rates[5]
    assert power_w == pytest.approx(sum(a * b for a, b in zip(wrench, twist, strict=True)), abs=1e-9)


@given(TURNS, st.floats(-0.8, 0.3), RATES, RATES, st.floats(-1.0, 1.0))
def test_a_level_body_carries_its_flippers_as_a_rail_does(
    sweep_rad: float, adduction_rad: float, sweep_rad_s: float, adduction_rad_s: float, body_m_s: float
) -> None:
    body = make_body()
    body.forward_m_s = body_m_s
    for carriage in body.carriages:
        attitude = carried_attitude(GEOMETRY, carriage, sweep_rad, adduction_rad, 0.0)
        assert attitude == pytest.approx(attitude_of(GEOMETRY, sweep_rad, adduction_rad))
        twist = carried_twist(GEOMETRY, carriage, sweep_rad, adduction_rad, sweep_rad_s, adduction_rad_s)
        assert twist == pytest.approx(
            twist_of(GEOMETRY, ArmMotion(sweep_rad, adduction_rad, sweep_rad_s, adduction_rad_s, body_m_s))
        )


@given(TURNS, TURNS, st.tuples(*[st.floats(-0.2, 0.2)] * 3), RATES, RATES)
def test_a_force_on_the_body_does_the_work_of_its_point(
    roll_rad: float, pitch_rad: float, point: tuple[float, float, float], roll_rad_s: float, pitch_rad_s: float
) -> None:
    axes, moved_s = axes_of(roll_rad, pitch_rad), 1e-6
    load = load_at(axes, in_world(axes, point), 3.0, -2.0)
    after_m, before_m = (
        turned(roll_rad + sign * moved_s * roll_rad_s, pitch_rad + sign * moved_s * pitch_rad_s) @ np.array(point)
        for sign in (1.0, -1.0)
    )
    velocity_m_s = (after_m - before_m) / (2.0 * moved_s)
    power_w = load.roll_nm * roll_rad_s + load.pitch_nm * pitch_rad_s
    assert power_w == pytest.approx(3.0 * velocity_m_s[0] - 2.0 * velocity_m_s[2], abs=1e-8)


@given(TURNS, TURNS)
def test_the_world_s_directions_are_the_rows_of_the_rotation(roll_rad: float, pitch_rad: float) -> None:
    assert np.array(axes_of(roll_rad, pitch_rad)) == pytest.approx(turned(roll_rad, pitch_rad))


def test_it_falls_freely_until_it_meets_the_mud() -> None:
    body = make_body()
    body.height_m += 0.1
    live(body, 0.1)
    assert body.upward_m_s == pytest.approx(-0.981)
    live(body, 0.4)
    assert abs(body.upward_m_s) < 0.01


@pytest.mark.parametrize("water", MUDS)
def test_at_rest_it_lies_where_the_mud_s_bearing_carries_its_weight(water: str) -> None:
    """The mud is elastic down to YIELD_M, where the bearing N_c s_u A is reached; buoyancy acts from the surface on."""
    body = make_body(MUDS[water])
    live(body, 2.0)
    per_m = 5.14 * MUDS[water].strength_pa * AREA_M2 / YIELD_M + 17.5e3 * AREA_M2
    assert SHAPE.axis_above_belly_m - body.height_m == pytest.approx(WEIGHT_N / per_m, rel=1e-3)
    assert (body.roll_rad, body.forward_m) == (0.0, 0.0)


def test_on_mud_that_cannot_carry_it_the_body_sinks_until_it_floats() -> None:
    weak = Clay("weak", 120.0)
    body = make_body(weak)
    live(body, 5.0)
    bearing_n = rate_factor(0.0) * 5.14 * weak.strength_pa * AREA_M2
    least_m = (WEIGHT_N - bearing_n) / (17.5e3 * AREA_M2)
    assert least_m > 0.01  # far beyond its elastic depth
    assert abs(body.upward_m_s) < 0.001
    # Released on the surface it overshoots at most to twice the depth, like a weight on an undamped spring.
    assert least_m < SHAPE.axis_above_belly_m - body.height_m < 2.0 * least_m


@pytest.mark.parametrize("seed", range(6))
def test_mud_never_returns_more_energy_to_a_falling_sliding_rolling_body_than_it_received(seed: int) -> None:
    random, dt_s = Random(seed), 0.0001
    tracks = (Track([(9.0, MUDS["53.1"])]), Track([(0.06, MUDS["53.1"]), (9.0, MUDS["45.3"])]))
    body = FreeBody(MASS_KG, SHAPE, DragPad(0.015, 0.02), tracks[seed % 2])
    body.height_m += random.uniform(0.03, 0.06)  # above the mud, which has stored no energy yet
    body.roll_rad, body.pitch_rad = random.uniform(-0.15, 0.15), random.uniform(-0.2, 0.2)
    body.forward_m_s, body.pitch_rad_s = random.uniform(-0.5, 1.0), random.uniform(-2.0, 2.0)

    def energy_j() -> float:
        turning_j = SHAPE.roll_inertia_kg_m2 * body.roll_rad_s**2 + SHAPE.pitch_inertia_kg_m2 * body.pitch_rad_s**2
        moving_j = MASS_KG * hypot(body.forward_m_s, body.upward_m_s) ** 2
        return (turning_j + moving_j) / 2.0 + WEIGHT_N * body.height_m

    begun_j = energy_j()
    for _ in range(15000):
        body.step(dt_s, Still(), Still())
        assert energy_j() <= begun_j + 1e-9
    assert energy_j() < begun_j - 0.01
    assert hypot(body.forward_m_s, body.upward_m_s, body.roll_rad_s, body.pitch_rad_s) < 0.02  # it comes to rest


def test_where_the_mud_becomes_stiffer_the_force_stays_and_where_it_becomes_softer_the_strain() -> None:
    soft, stiff, quarter = Clay("soft", 500.0), Clay("stiff", 2000.0), BellyQuarter(0.004, 0.25)
    first_n, stiffer_n, softer_n = (quarter.step(clay, 1.0, 0.002, 0.0) for clay in (soft, stiff, soft))
    floating_n = 17.5e3 * 0.004 * 0.002
    assert first_n == pytest.approx(floating_n + 5.14 * 500.0 * 0.004 * 2.0 / 3.0)
    assert stiffer_n == pytest.approx(first_n)
    assert softer_n - floating_n == pytest.approx((first_n - floating_n) / 4.0)


@given(st.floats(0.002, 0.02), st.floats(0.0, 0.01), st.integers(1, 3))
def test_a_quarter_pressed_again_and_again_into_changing_mud_never_adds_energy(
    amplitude_m: float, middle_m: float, rounds: int
) -> None:
    quarter, given_j, steps = BellyQuarter(0.004, 0.25), 0.0, 2000
    for step in range(rounds * steps):
        angle = 2.0 * pi * (step + 0.5) / steps
        depth_m, sinking_m_s = (
            middle_m - (amplitude_m + 0.01) * cos(angle),
            2.0 * pi * (amplitude_m + 0.01) * sin(angle),
        )
        clay = Clay("any", 500.0 if step // 170 % 2 else 4500.0)
        given_j -= quarter.step(clay, rate_factor(abs(sinking_m_s)), depth_m, sinking_m_s) * sinking_m_s / steps
        assert (
            given_j < 1e-6
        )  # a step of 40 um in the stiffest mud has 25 uJ, and midpoint sums leave little error of it
    assert given_j < -0.001 * rounds


def test_adhesion_on_the_belly_and_the_pad_hold_it_until_they_yield() -> None:
    clay, pad = MUDS["48.5"], DragPad(0.015, 0.02)
    sticking_n = 0.25 * clay.strength_pa * AREA_M2
    for thrust_n, speed_m_s in ((0.9 * rate_factor(0.0) * sticking_n, 0.0), (rate_factor(0.3) * sticking_n, 0.3)):
        body, pushing = make_body(clay), Still(NO_CONTACT._replace(normal_n=thrust_n / 2.0))
        live(body, 0.5)
        live(body, 8.0, pushing, pushing)
        assert body.forward_m_s == pytest.approx(speed_m_s, abs=0.01)
    padded = make_body(clay, pad)
    live(padded, 8.0, pushing, pushing)
    assert padded.forward_m_s < 0.2  # the pad adds a third


def test_mud_sticks_only_to_a_belly_that_presses_on_it() -> None:
    body = make_body()
    live(body, 0.5)
    lifting = Still(NO_CONTACT._replace(upward_n=0.51 * WEIGHT_N))
    live(body, 0.5, lifting, lifting)
    assert body.height_m > SHAPE.axis_above_belly_m
    body.forward_m_s = 0.2
    live(body, 0.1, lifting, lifting)
    assert body.forward_m_s == pytest.approx(0.2)


def test_a_print_carries_no_load_until_the_belly_is_back_in_it_or_was_clear_of_the_mud() -> None:
    clay, quarter = Clay("any", 1000.0), BellyQuarter(0.004, 0.25)
    floating_n = 17.5e3 * 0.004 * 0.004
    assert quarter.step(clay, 1.0, 0.005, 0.0) == pytest.approx(5.14 * 1000.0 * 0.004 + 17.5e3 * 0.004 * 0.005)
    assert quarter.step(clay, 1.0, 0.0019, 0.0) == pytest.approx(17.5e3 * 0.004 * 0.0019)
    assert not quarter.pressed
    assert quarter.step(clay, 1.0, 0.004, 0.0) == pytest.approx(5.14 * 1000.0 * 0.004 * 2.0 / 3.0 + floating_n)
    assert quarter.step(clay, 1.0, 0.0, 0.0) == 0.0
    assert quarter.step(clay, 1.0, 0.0019, 0.0) > 5.14 * 1000.0 * 0.004 * 0.6


def test_both_flippers_pushed_down_in_front_lift_the_nose_and_at_the_rear_the_tail() -> None:
    pitches_rad = []
    for sweep_rad in (0.5, -0.5):
        plant = Plant(FREE, Track([(9.0, Clay("stiff", 8000.0))]))
        for arm in plant.arms:
            arm.sweep_rad, arm.adduction_rad = sweep_rad, GEOMETRY.adduction_rad(sweep_rad, 0.0)
        for _ in range(300):
            plant.step(STEP_S, Joints(0.0, -0.7, 0.0, -0.7))
        pitches_rad.append(plant.motion.pitch_rad)  # a positive pitch lowers the nose
    assert pitches_rad[0] < -0.02
    assert pitches_rad[1] > 0.02


def test_both_flippers_pushed_down_at_the_sides_lift_the_body() -> None:
    plant = Plant(FREE, Track([(9.0, Clay("stiff", 8000.0))]))
    body = plant.body
    assert isinstance(body, FreeBody)
    for _ in range(400):
        plant.step(STEP_S, Joints(0.0, -1.0, 0.0, -1.0))
    assert body.height_m > body.shape.axis_above_belly_m  # clear of the mud
    carried_n = sum(load.upward_n for load in body.flipper_loads(axes_of(0.0, 0.0), *plant.arms))
    assert carried_n == pytest.approx(body.mass_kg * 9.81, rel=0.05)  # it still rocks on the plates
    assert abs(body.pitch_rad) < 0.01


@pytest.mark.parametrize("side", [0, 1])
def test_one_flipper_pushed_down_raises_its_own_side(side: int) -> None:
    plant = Plant(FREE, Track([(9.0, MUDS["45.3"])]))
    for _ in range(200):
        plant.step(STEP_S, Joints(0.0, -0.5, 0.0, 0.1) if side == 0 else Joints(0.0, 0.1, 0.0, -0.5))
    assert (1.0 if side == 0 else -1.0) * plant.motion.roll_rad > 0.02


def test_a_lifted_body_s_flippers_are_less_deep() -> None:
    for raised_m, touches in ((0.005, True), (0.02, False)):
        plant = Plant(FREE, Track([(9.0, MUDS["48.5"])]))
        assert isinstance(plant.body, FreeBody)
        plant.body.height_m += raised_m
        arm = plant.arms[0]
        arm.adduction_rad, arm.adduction_velocity_rad_s = GEOMETRY.adduction_rad(0.0, 0.01), -0.1
        plant.step(STEP_S, NO_TORQUE)
        assert (arm.force.upward_n > 0.0) == touches


def test_equal_strokes_left_and_right_never_roll_it() -> None:
    plant = Plant(FREE, Track([(9.0, MUDS["48.5"])]))
    for torques_nm in ((0.0, -0.3), (-0.6, -0.1), (0.0, 0.6), (0.1, 0.05)) * 2:
        for _ in range(200):
            plant.step(STEP_S, Joints(*torques_nm, *torques_nm))
            assert (plant.motion.roll_rad, plant.motion.roll_rad_s) == (0.0, 0.0)
    assert plant.body_m > 0.004


def test_a_reset_brings_everything_back() -> None:
    plant, outcomes = Plant(FREE, Track([(9.0, MUDS["48.5"])])), []
    for _ in range(2):
        for torques_nm in ((0.0, -0.3), (-0.6, -0.1), (0.0, 0.6)):
            for _ in range(200):
                plant.step(STEP_S, Joints(*torques_nm, 0.0, 0.0))
        outcomes.append((plant.body_m, plant.motion, plant.angles_rad))
        plant.reset()
    assert outcomes[0] == outcomes[1]


def test_a_body_cannot_be_fixed_and_free() -> None:
    with pytest.raises(ValueError, match="fixed base"):
        PlantParameters(fixed_base=True, free_body=True)


@pytest.fixture(scope="module")
def begun(configuration: Configuration) -> Lockstep:
    lockstep = Lockstep(configuration, Track([(9.0, MUDS["48.5"])]), plant=plant_of(configuration, free_body=True))
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03, adaptive=False))
    lockstep.run_for(2.5)
    return lockstep


@pytest.fixture(scope="module")
def walking(begun: Lockstep) -> Lockstep:
    lockstep = copy_of(begun)
    lockstep.run_for(3.0)
    return lockstep


def test_a_free_body_walks_forward_on_firm_mud(walking: Lockstep) -> None:
    assert walking.loop.fault is None
    assert len(walking.loop.learning.strides) >= 6
    assert walking.robot.plant.body_m > 0.08


def test_a_free_body_s_joints_have_the_configured_height(configuration: Configuration) -> None:
    higher = replace(configuration, geometry=replace(configuration.geometry, axis_height_m=0.07))
    assert plant_of(higher).body.axis_above_belly_m == 0.07


def test_a_walk_of_a_free_body_hardly_depends_on_the_step_of_the_simulation(
    configuration: Configuration, begun: Lockstep, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simulation.harness.robot.STEP_S", 0.00025)
    fine = Lockstep(configuration, Track([(9.0, MUDS["48.5"])]), plant=plant_of(configuration, free_body=True))
    fine.arm()
    fine.walk(WalkOrder(0.03, adaptive=False))
    fine.run_for(2.5)
    assert fine.robot.plant.body_m == pytest.approx(begun.robot.plant.body_m, rel=0.1)


def test_moments_of_a_flipper_on_a_level_body_are_levers_times_forces() -> None:
    """An upward force at the plate's edge rolls the body by the arm's length and pitches it by the sweep."""
    sweep_rad, adduction_rad = 0.4, -0.5
    plate = plate_in_body(sweep_rad, adduction_rad, 1.0)
    along = plate[:, :3].T @ np.array([0.0, 0.0, 5.0])
    force = contact_force(GEOMETRY, sweep_rad, Wrench(*along))
    level = Axes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    joint = (AHEAD_M, SHAPE.width_m / 2.0, 0.0)
    x_m, y_m, _ = GEOMETRY.edge_position(sweep_rad, adduction_rad)
    flipper = Still(force)
    flipper.sweep_rad, flipper.adduction_rad = sweep_rad, adduction_rad
    load = load_of_flipper(level, joint, flipper, 1.0)
    assert load == pytest.approx((0.0, 5.0, 5.0 * (y_m + joint[1]), -5.0 * (x_m + joint[0])), abs=1e-12)
