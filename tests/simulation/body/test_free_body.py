"""The free body agrees with rotation matrices, with finite differences, and with the laws of mechanics."""

from dataclasses import replace
from math import cos, hypot, pi, sin
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from control.controller import WalkOrder
from control.geometry import FlipperGeometry
from control.records import Joints
from firmware_host.configuration.configuration import Configuration
from simulation.body.free_body import YIELD_M, BellyQuarter, BodyShape, FreeBody, axes_of, in_world, load_at
from simulation.body.plant import STEP_S, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.body.rail_body import DragPad
from simulation.harness.lockstep import Lockstep, plant_of
from simulation.mud.carriage import LEAST_UPRIGHT, carried_attitude, carried_twist
from simulation.mud.clay import MUDS, Clay, rate_factor
from simulation.mud.flipper_contact import NO_CONTACT, ContactForce, contact_force
from simulation.mud.rigid_plate import Wrench
from simulation.mud.track import Track
from tests.control.test_geometry import rotation

GEOMETRY, SHAPE, MASS_KG = FlipperGeometry(), BodyShape(), 1.02
AHEAD_M = 0.02  # the joints are ahead of the centre of mass, where geometry is tested
AREA_M2 = SHAPE.length_m * SHAPE.width_m
WEIGHT_N = MASS_KG * 9.81
NO_PAD = DragPad(0.0, 0.0)
FREE = PlantParameters(free_body=True)
QUARTER_M2 = 0.004
POSITIONS_M = [(u, s) for u in (-0.0125, 0.0, 0.0125) for s in (0.0, 0.07)]  # corners and midpoints
turns = st.floats(-0.6, 0.6)
rates = st.floats(-3.0, 3.0)
sides = st.sampled_from([1.0, -1.0])
states = st.tuples(st.floats(-1.0, 1.0), st.floats(0.0, 0.1), turns, turns, turns, st.floats(-0.8, 0.3)).map(np.array)
speeds = st.tuples(*[rates] * 6).map(np.array)


class Still:
    """A flipper with a constant force of the mud, or none."""

    def __init__(self, force: ContactForce = NO_CONTACT, sweep_rad: float = 0.0, adduction_rad: float = 0.0) -> None:
        self.force, self.sweep_rad, self.adduction_rad = force, sweep_rad, adduction_rad


def make_body(clay: Clay = MUDS["48.5"], pad: DragPad = NO_PAD) -> FreeBody:
    return FreeBody(MASS_KG, SHAPE, pad, Track([(9.0, clay)]))


def live(body: FreeBody, seconds: float, flipper: Still | None = None) -> None:
    """Let a body live with the same force on both flippers."""
    for _ in range(round(seconds / STEP_S)):
        body.step(STEP_S, flipper or Still(), flipper or Still())


def turned(roll_rad: float, pitch_rad: float) -> np.ndarray:
    """Return the textbook rotation from the body's axes to the world's."""
    sr, cr, sp, cp = np.sin(roll_rad), np.cos(roll_rad), np.sin(pitch_rad), np.cos(pitch_rad)
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    return np.asarray(about_y @ np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]]))


def plate_in_body(sweep_rad: float, adduction_rad: float, side: float) -> np.ndarray:
    """Return as columns the plate's axes n, r and s and the intersection of the joints' axes; y is to the left."""
    joints = np.array([[AHEAD_M], [SHAPE.width_m / 2.0], [0.0]])
    return np.asarray(np.diag([1.0, side, 1.0]) @ np.hstack([rotation(sweep_rad, adduction_rad), joints]))


def point_in_world(state: np.ndarray, side: float, u: float, s: float) -> np.ndarray:
    """Return the point (u, s) of the plate; `state` is forward, height, roll, pitch, sweep, adduction."""
    forward_m, height_m, roll_rad, pitch_rad, sweep_rad, adduction_rad = state
    along = np.array([0.0, GEOMETRY.flipper_length_m + u, s - GEOMETRY.drop_m, 1.0])
    own_m = turned(roll_rad, pitch_rad) @ plate_in_body(sweep_rad, adduction_rad, side) @ along
    return np.asarray(own_m + [forward_m, 0.0, height_m])


def body_in(state: np.ndarray, rates: np.ndarray) -> FreeBody:
    body = FreeBody(MASS_KG, BodyShape(axis_forward_m=AHEAD_M), NO_PAD, Track([(9.0, MUDS["48.5"])]))
    body.forward_m, body.height_m, body.roll_rad, body.pitch_rad = state[:4]
    body.forward_m_s, body.upward_m_s, body.roll_rad_s, body.pitch_rad_s = rates[:4]
    return body


@given(states, sides)
def test_a_carried_plate_has_the_depth_of_rotation_matrices(state: np.ndarray, side: float) -> None:
    carriage = body_in(state, np.zeros(6)).carriages[side < 0.0]
    attitude = carried_attitude(GEOMETRY, carriage, state[4], state[5], 0.004)
    for u, s in POSITIONS_M:
        reported_m = attitude.depth_m + attitude.per_outward * u - attitude.per_upward * s
        assert reported_m == pytest.approx(-point_in_world(state, side, u, s)[2] - 0.004)


def test_a_plate_on_a_tipped_body_never_lies_flat() -> None:
    body = make_body()
    body.roll_rad = 1.5
    left, right = (carried_attitude(GEOMETRY, carriage, 0.0, 0.5, 0.0) for carriage in body.carriages)
    assert left.per_upward == LEAST_UPRIGHT
    assert right.per_upward == pytest.approx(cos(1.0))


@given(states, speeds, sides, st.tuples(*[st.floats(-10.0, 10.0)] * 7))
def test_joints_and_body_get_the_work_that_the_mud_does_on_a_carried_plate(
    state: np.ndarray, rates: np.ndarray, side: float, parts: tuple[float, ...]
) -> None:
    body, force = body_in(state, rates), contact_force(GEOMETRY, state[4], Wrench(*parts))
    pair = [Still(force, *state[4:]), Still()][:: round(side)]
    (load,) = body.flipper_loads(axes_of(state[2], state[3]), *pair)
    twist = carried_twist(GEOMETRY, body.carriages[side < 0.0], *state[4:], *rates[4:])
    power_w = np.dot([*load, *force[:2]], rates)
    assert power_w == pytest.approx(np.dot(parts, twist), abs=1e-9)


@given(turns, turns, st.tuples(*[st.floats(-0.2, 0.2)] * 3), rates, rates)
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


@pytest.mark.parametrize("water", MUDS)
def test_it_falls_freely_and_comes_to_rest_where_the_mud_s_bearing_carries_its_weight(water: str) -> None:
    """The mud is elastic down to YIELD_M, where the bearing N_c s_u A is reached; buoyancy acts from the surface on."""
    body = make_body(MUDS[water])
    body.height_m += 0.001
    live(body, 0.01)
    assert body.upward_m_s == pytest.approx(-0.0981)
    body.height_m, body.upward_m_s = SHAPE.axis_above_belly_m, 0.0
    live(body, 1.5)
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


@pytest.mark.parametrize("seed", range(4))
def test_mud_never_returns_more_energy_to_a_falling_sliding_rolling_body_than_it_received(seed: int) -> None:
    random, dt_s = Random(seed), 0.0002
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
    for _ in range(6000):
        body.step(dt_s, Still(), Still())
        assert energy_j() <= begun_j + 1e-9
    assert energy_j() < begun_j - 0.01
    assert hypot(body.forward_m_s, body.upward_m_s, body.roll_rad_s, body.pitch_rad_s) < 0.02  # it comes to rest


def test_where_the_mud_becomes_stiffer_the_force_stays_and_where_it_becomes_softer_the_strain() -> None:
    soft, stiff, quarter = Clay("soft", 500.0), Clay("stiff", 2000.0), BellyQuarter(QUARTER_M2, 0.25)
    first_n, stiffer_n, softer_n = (quarter.step(clay, 1.0, 0.002, 0.0) for clay in (soft, stiff, soft))
    floating_n = 17.5e3 * QUARTER_M2 * 0.002
    assert first_n == pytest.approx(floating_n + 5.14 * 500.0 * QUARTER_M2 * 2.0 / 3.0)
    assert stiffer_n == pytest.approx(first_n)
    assert softer_n - floating_n == pytest.approx((first_n - floating_n) / 4.0)


@settings(max_examples=10)
@given(st.floats(0.012, 0.03), st.floats(0.0, 0.01), st.integers(1, 3))
def test_a_quarter_pressed_again_and_again_into_changing_mud_never_adds_energy(
    amplitude_m: float, middle_m: float, rounds: int
) -> None:
    """A step of 40 um in the stiffest mud has 25 uJ, and midpoint sums leave little error of it."""
    quarter, given_j, steps = BellyQuarter(QUARTER_M2, 0.25), 0.0, 2000
    for step in range(rounds * steps):
        angle = 2.0 * pi * (step + 0.5) / steps
        sinking_m_s = 2.0 * pi * amplitude_m * sin(angle)
        clay = Clay("any", 500.0 if step // 170 % 2 else 4500.0)
        force_n = quarter.step(clay, rate_factor(abs(sinking_m_s)), middle_m - amplitude_m * cos(angle), sinking_m_s)
        given_j -= force_n * sinking_m_s / steps
        assert given_j < 1e-6
    assert given_j < -0.001 * rounds


def test_adhesion_on_the_belly_and_the_pad_hold_it_until_they_yield() -> None:
    sticking_n = 0.25 * MUDS["48.5"].strength_pa * AREA_M2
    for traction, speed_m_s, seconds in ((0.9 * rate_factor(0.0), 0.0, 2.0), (rate_factor(0.3), 0.3, 8.0)):
        body, pushing = make_body(), Still(NO_CONTACT._replace(normal_n=traction * sticking_n / 2.0))
        live(body, 0.5)
        live(body, seconds, pushing)
        assert body.forward_m_s == pytest.approx(speed_m_s, abs=0.01)
    padded = make_body(pad=DragPad(0.015, 0.02))
    live(padded, 4.0, pushing)
    assert padded.forward_m_s < 0.2  # the pad adds a third


@pytest.mark.parametrize(
    ("sweep_rad", "lift_nm", "lifts", "pitches", "rolls"),
    [
        (0.5, (-0.7, -0.7), False, -1.0, 0.0),  # in front: the nose rises, which is a negative pitch
        (-0.5, (-0.7, -0.7), False, 1.0, 0.0),
        (0.0, (-1.0, -1.0), True, 0.0, 0.0),
        (0.0, (-0.5, 0.1), False, 0.0, 1.0),
        (0.0, (0.1, -0.5), False, 0.0, -1.0),
    ],
)
def test_flippers_pushed_down_raise_their_part_of_the_body(
    sweep_rad: float, lift_nm: tuple[float, float], lifts: bool, pitches: float, rolls: float
) -> None:
    plant = Plant(FREE, Track([(9.0, Clay("stiff", 8000.0))]))
    for arm in plant.arms:
        arm.sweep_rad, arm.adduction_rad = sweep_rad, GEOMETRY.adduction_rad(sweep_rad, 0.0)
    for _ in range(400 if lifts else 200):
        plant.step(STEP_S, Joints(0.0, lift_nm[0], 0.0, lift_nm[1]))
    body, motion = plant.body, plant.motion
    assert isinstance(body, FreeBody)
    for angle_rad, raised in ((motion.pitch_rad, pitches), (motion.roll_rad, rolls)):
        assert angle_rad * raised > 0.02 if raised else abs(angle_rad) < 0.01
    if not rolls:
        assert (motion.roll_rad, motion.roll_rad_s) == (0.0, 0.0)  # equal strokes left and right never roll it
    if lifts:
        assert body.height_m > body.shape.axis_above_belly_m  # clear of the mud
        carried_n = sum(load.upward_n for load in body.flipper_loads(axes_of(0.0, 0.0), *plant.arms))
        assert carried_n == pytest.approx(body.mass_kg * 9.81, rel=0.05)  # it still rocks on the plates


def test_a_body_cannot_be_fixed_and_free() -> None:
    with pytest.raises(ValueError, match="fixed base"):
        PlantParameters(fixed_base=True, free_body=True)


def test_a_free_body_walks_forward_on_firm_mud(configuration: Configuration) -> None:
    plant = plant_of(configuration, free_body=True)
    robot = Lockstep(configuration, Track([(9.0, MUDS["48.5"])]), plant=plant)
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False))
    assert robot.run_until(lambda: len(robot.loop.learning.strides) >= 2, 4.0)
    assert robot.loop.fault is None and robot.robot.plant.body_m > 0.02


def test_an_overturned_body_is_set_down_on_its_belly_where_it_is(configuration: Configuration) -> None:
    robot = Plant(plant_of(configuration, free_body=True), Track([(9.0, MUDS["48.5"])]))
    assert isinstance(body := robot.body, FreeBody)
    body.forward_m, body.pitch_rad, body.height_m = 0.4, -3.3, -0.1
    robot.put_back()
    for _ in range(500):
        robot.step(STEP_S, Joints(0.0, 0.0, 0.0, 0.0))
    assert body.forward_m == pytest.approx(0.4, abs=1e-3)
    assert abs(body.pitch_rad) < 0.02
    assert all(abs(arm.sweep_rad) < 0.02 for arm in robot.arms)


def test_a_free_body_s_joints_have_the_configured_height(configuration: Configuration) -> None:
    higher = replace(configuration, geometry=replace(configuration.geometry, axis_height_m=0.07))
    assert plant_of(higher).body.axis_above_belly_m == 0.07
