"""The mechanics of arms and body, without the controller."""

from dataclasses import replace
from math import exp, pi, radians, sin, sqrt
from random import Random

import pytest

from control.parameters.arm_mass import ArmMass
from control.records import Joints
from simulation.body.plant import END_STOPS_RAD, STEP_S, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.body.rail_body import DRAG_STIFFNESS_N_M
from simulation.mud.carriage import Carriage
from simulation.mud.clay import MUDS, Clay, rate_factor
from simulation.mud.disturbances import LAB, Disturbances
from simulation.mud.flipper_contact import NO_CONTACT, ArmMotion, ContactForce, FlipperContact
from simulation.mud.rigid_plate import Attitude
from simulation.mud.track import Track
from tests.control.synthetic_states import NO_TORQUE

TRACK = Track([(1.0, MUDS["48.5"])])
WITHOUT_FRICTION = PlantParameters(joint_friction_nm_s=0.0)
MOMENT_NM = 0.08 * 9.81 * 0.06


class ConstantThrust(FlipperContact):
    """A contact with mud that always pushes with the same force."""

    thrust_n = 0.0

    def step(
        self, dt_s: float, clay: Clay, motion: ArmMotion, attitude: Attitude, carriage: Carriage | None = None
    ) -> ContactForce:
        return NO_CONTACT._replace(thrust_n=self.thrust_n)


def make_air_plant(parameters: PlantParameters = WITHOUT_FRICTION) -> Plant:
    """Return a plant with level arms and without mud."""
    plant = Plant(parameters, TRACK)
    for arm in plant.arms:
        arm.adduction_rad = 0.0
        arm.contact = ConstantThrust(parameters.geometry)
    return plant


def make_pushed_plant(thrust_n: float, seconds: float) -> Plant:
    plant = Plant(PlantParameters(), TRACK)
    for arm in plant.arms:
        arm.contact = ConstantThrust(plant.parameters.geometry)
        arm.contact.thrust_n = thrust_n / 2.0
    run(plant, seconds)
    return plant


def run(plant: Plant, seconds: float, dt_s: float = STEP_S) -> None:
    for _ in range(round(seconds / dt_s)):
        plant.step(dt_s, NO_TORQUE)


def static_drag_n() -> float:
    return 2.5 + rate_factor(0.0) * MUDS["48.5"].lateral_n(0.02, 0.015)


def test_a_falling_arm_turns_height_into_speed() -> None:
    plant = make_air_plant()
    while plant.arms[0].adduction_rad > radians(-60.0):
        plant.step(0.0001, NO_TORQUE)
    fallen_rad = -plant.arms[0].adduction_rad
    expected_rad_s = sqrt(2.0 * MOMENT_NM * sin(fallen_rad) / 0.0006)
    assert plant.arms[0].adduction_velocity_rad_s == pytest.approx(-expected_rad_s, rel=0.01)
    assert plant.arms[0].sweep_rad == 0.0


def test_a_hanging_arm_swings_with_the_period_of_a_pendulum() -> None:
    hardly_falling = ArmMass(adduction_inertia_kg_m2=1000.0)
    plant = make_air_plant(replace(WITHOUT_FRICTION, arm_mass=hardly_falling))
    arm = plant.arms[0]
    arm.adduction_rad, arm.sweep_rad = radians(-80.0), 0.05
    crossings_s, before = [], arm.sweep_rad
    for step in range(30000):
        plant.step(0.0001, NO_TORQUE)
        if before < 0.0 <= arm.sweep_rad:
            crossings_s.append(step * 0.0001)
        before = arm.sweep_rad
    period_s = (crossings_s[-1] - crossings_s[0]) / (len(crossings_s) - 1)
    assert period_s == pytest.approx(2.0 * pi * sqrt(0.0004 / (MOMENT_NM * sin(radians(80.0)))), rel=0.005)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_arms_stop_at_their_end_stops(sign: float) -> None:
    plant = make_air_plant()
    for _ in range(1000):
        plant.step(STEP_S, Joints(sign * 0.5, sign * 0.5, sign * 0.5, sign * 0.5))
    sweep_rad, adduction_rad = (sign * stop for stop in END_STOPS_RAD)
    assert plant.angles_rad == (sweep_rad, adduction_rad, sweep_rad, adduction_rad)
    assert plant.velocities_rad_s == (0.0, 0.0, 0.0, 0.0)


def test_friction_slows_an_arm_down() -> None:
    plant = make_air_plant(PlantParameters(joint_friction_nm_s=0.002, arm_mass=ArmMass(arm_mass_kg=0.0)))
    plant.arms[0].sweep_velocity_rad_s = 1.0
    run(plant, 0.2)
    assert plant.arms[0].sweep_velocity_rad_s == pytest.approx(exp(-1.0), rel=0.01)  # 0.0004 / 0.002 = 0.2 s


DRY = PlantParameters(joint_friction_nm_s=0.0, joint_coulomb_nm=0.02, arm_mass=ArmMass(arm_mass_kg=0.0))


def test_dry_friction_slows_an_arm_down_evenly_until_it_stands() -> None:
    plant = make_air_plant(DRY)
    arm = plant.arms[0]
    arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s = 2.0, -2.0
    run(plant, 0.02)
    assert arm.sweep_velocity_rad_s == pytest.approx(2.0 - 0.02 * 0.02 / 0.0004)
    assert arm.adduction_velocity_rad_s == pytest.approx(-2.0 + 0.02 * 0.02 / 0.0006)
    run(plant, 0.1)
    assert plant.velocities_rad_s == (0.0, 0.0, 0.0, 0.0)
    assert arm.sweep_rad == pytest.approx(2.0**2 / 2.0 * 0.0004 / 0.02, rel=0.03)  # v²/2a; a step is 1/40 of the stop


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_dry_friction_holds_a_joint_up_to_its_torque_and_then_opposes_its_motion(sign: float) -> None:
    plant = make_air_plant(DRY)
    for _ in range(100):
        plant.step(STEP_S, Joints(sign * 0.0199, sign * 0.0199, 0.0, 0.0))
    assert plant.angles_rad == (0.0, 0.0, 0.0, 0.0)
    for _ in range(10):
        plant.step(STEP_S, Joints(sign * 0.03, sign * 0.03, 0.0, 0.0))
    rates_rad_s = [sign * 0.01 * 0.01 / inertia_kg_m2 for inertia_kg_m2 in (0.0004, 0.0006)]
    assert plant.velocities_rad_s == pytest.approx((*rates_rad_s, 0.0, 0.0))


def test_a_load_that_dry_friction_can_hold_never_makes_a_joint_creep() -> None:
    plant = make_air_plant(PlantParameters(joint_coulomb_nm=0.05))  # more than the level arm's weight
    run(plant, 20.0)
    assert plant.angles_rad == (0.0, 0.0, 0.0, 0.0)


def test_unpowered_flippers_rest_on_the_mud_and_the_body_stays() -> None:
    plant = Plant(PlantParameters(), TRACK)
    run(plant, 5.0)
    depth_m = plant.parameters.geometry.depth_m(*plant.angles_rad[:2])
    assert 0.0 < depth_m < 0.01
    assert abs(plant.body_m) < 0.005


def test_left_and_right_are_alike() -> None:
    plant = Plant(PlantParameters(), TRACK)
    for _ in range(500):
        plant.step(STEP_S, Joints(-0.7, -0.3, -0.7, -0.3))
    assert plant.angles_rad[:2] == plant.angles_rad[2:]
    assert plant.arms[0].force == plant.arms[1].force


@pytest.mark.parametrize("side", [0, 1])
def test_one_flipper_alone_moves_and_pushes(side: int) -> None:
    plant = make_air_plant()
    pushing = ConstantThrust(plant.parameters.geometry)
    pushing.thrust_n = 20.0
    plant.arms[side].contact = pushing
    for _ in range(100):
        plant.step(STEP_S, Joints(0.01, 0.06, 0.0, 0.0) if side == 0 else Joints(0.0, 0.0, 0.01, 0.06))
    own_rad, other_rad = (plant.angles_rad[2 * flipper : 2 * flipper + 2] for flipper in (side, 1 - side))
    assert own_rad[0] > 0.0 == other_rad[0]
    assert own_rad[1] > 0.0 > other_rad[1]  # the other one falls
    assert plant.body_m > 0.01


def test_the_body_stays_under_a_thrust_below_its_drag() -> None:
    thrust_n = 0.45 * static_drag_n()  # half: a sudden push swings an elastic body twice as far
    assert 0.0 <= make_pushed_plant(thrust_n, 10.0).body_m <= 2.01 * thrust_n / DRAG_STIFFNESS_N_M


def test_the_body_slides_under_a_thrust_above_its_drag_at_the_speed_that_balances() -> None:
    thrust_n = 2.5 + 6.0 * 0.3 + rate_factor(0.3) * MUDS["48.5"].lateral_n(0.02, 0.015)
    plant = make_pushed_plant(thrust_n, 10.0)
    assert plant.body_m_s == pytest.approx(0.3, rel=0.01)
    assert plant.body_m > 1.0


def test_the_body_comes_to_rest_after_a_push() -> None:
    plant = make_pushed_plant(20.0, 0.1)
    for arm in plant.arms:
        arm.contact = ConstantThrust(plant.parameters.geometry)
    run(plant, 5.0)
    positions_m = []
    for _ in range(200):
        plant.step(STEP_S, NO_TORQUE)
        positions_m.append(plant.body_m)
    assert max(positions_m) - min(positions_m) < 1e-4


def test_a_quarter_of_the_step_gives_the_same_push() -> None:
    """The torques of a stance and an extraction are prescribed."""
    ends_m = []
    for dt_s in (0.001, 0.00025):
        plant = Plant(PlantParameters(), TRACK)
        for sweep_nm, lift_nm, seconds in ((0.0, -0.4, 0.5), (-0.5, -0.4, 0.25), (0.0, 0.6, 0.3)):
            for _ in range(round(seconds / dt_s)):
                plant.step(dt_s, Joints(sweep_nm, lift_nm, sweep_nm, lift_nm))
        ends_m.append(plant.body_m)
    assert ends_m[0] > 0.02
    assert ends_m[1] == pytest.approx(ends_m[0], rel=0.03)


def row(plant: Plant, strides: int = 2) -> list[float]:
    """Make strokes down, back, up and forward with prescribed torques; return body and angles at the end of each."""
    ends = []
    for _ in range(strides):
        for torques_nm in ((0.0, -0.2), (-0.6, -0.1), (0.0, 0.6), (0.1, 0.05)):
            for _ in range(300):
                plant.step(STEP_S, Joints(*torques_nm, *torques_nm))
            ends += [plant.body_m, *plant.angles_rad]
    return ends


@pytest.mark.parametrize("disturbances", [Disturbances(), LAB])
def test_a_reset_brings_everything_back(disturbances: Disturbances) -> None:
    plant = Plant(PlantParameters(disturbances=disturbances), TRACK, Random(3))
    first = row(plant)
    assert row(plant) != first
    plant.reset()
    assert row(plant) == first


def test_the_body_of_a_fixed_base_never_moves() -> None:
    plant, free = Plant(PlantParameters(fixed_base=True), TRACK), Plant(PlantParameters(), TRACK)
    # An elastic drag gives way by at most twice its static deflection under a sudden push, so the free body has slid.
    assert max(row(free)[::5]) > 2.0 * static_drag_n() / DRAG_STIFFNESS_N_M
    row(plant)
    assert (plant.body_m, plant.body_m_s) == (0.0, 0.0)
    assert max(abs(angle_rad) for angle_rad in plant.angles_rad) > 0.1


def test_the_flippers_have_histories_of_their_own_and_a_seed_repeats_them() -> None:
    plants = [Plant(PlantParameters(disturbances=LAB), TRACK, Random(seed)) for seed in (3, 3, 4)]
    for plant in plants:
        row(plant)
    first, second, third = ([(a.surface_m, a.history.clinging_n) for a in plant.arms] for plant in plants)
    assert first == second
    assert len({first[0], first[1], third[0], third[1]}) == 4
    assert all(clinging_n > 0.0 for _, clinging_n in first)


def test_an_arm_starts_with_its_edge_on_the_mud_that_it_meets() -> None:
    plant = Plant(PlantParameters(disturbances=Disturbances(surface_sd_m=0.003)), TRACK, Random(3))
    for arm in plant.arms:
        assert arm.surface_m != 0.0
        depth_m = plant.parameters.geometry.depth_m(arm.sweep_rad, arm.adduction_rad)
        assert depth_m == pytest.approx(arm.surface_m)


def test_a_flipper_feels_the_mud_from_its_own_surface_on() -> None:
    plant = Plant(PlantParameters(), TRACK)
    for arm, surface_m in zip(plant.arms, (-0.001, 0.003), strict=True):  # the lower corner is at 1.5 mm
        arm.adduction_rad = plant.parameters.geometry.adduction_rad(0.0, 0.0)
        arm.adduction_velocity_rad_s = -0.1
        arm.history.surface_m = surface_m
    plant.step(STEP_S, NO_TORQUE)
    left, right = plant.arms
    assert left.force.upward_n > 0.0
    assert right.force == NO_CONTACT


def test_an_arm_reports_the_remoulded_clay_under_its_flipper() -> None:
    plant = Plant(
        PlantParameters(disturbances=Disturbances(remoulding=1.0), fixed_base=True), Track([(9.0, Clay("any", 1000.0))])
    )
    assert [arm.clay for arm in plant.arms] == [Clay("any", 1000.0)] * 2
    torques_nm = (0.0, -0.3, 0.0, -0.3)
    strengths_pa = []
    for _ in range(3):
        for direction in (1.0, -2.0):
            for _ in range(300):
                plant.step(STEP_S, Joints(0.0, direction * torques_nm[1], 0.0, direction * torques_nm[3]))
            if direction > 0.0:
                strengths_pa.append(plant.arms[0].clay.strength_pa)
    assert strengths_pa == pytest.approx([500.0 + 500.0 * exp(-0.4 * earlier) for earlier in range(3)])


def test_the_clay_is_the_one_where_the_flipper_is_not_where_the_body_is() -> None:
    plant = Plant(PlantParameters(), Track([(0.05, MUDS["48.5"]), (1.0, MUDS["53.1"])]))
    plant.arms[0].sweep_rad, plant.arms[1].sweep_rad = radians(30.0), radians(-30.0)
    plant.step(STEP_S, NO_TORQUE)
    assert [arm.clay for arm in plant.arms] == [MUDS["53.1"], MUDS["48.5"]]


def test_a_flipper_that_carries_mud_is_heavier() -> None:
    falls = []
    for weight_n in (0.0, 0.5):
        plant = make_air_plant()
        plant.arms[0].history.clinging_n = weight_n
        plant.step(STEP_S, NO_TORQUE)
        falls.append(-plant.arms[0].adduction_velocity_rad_s * 0.0006 / STEP_S)
    assert falls == pytest.approx([MOMENT_NM, MOMENT_NM + 0.5 * 0.12])  # level arms: the lever is their length
