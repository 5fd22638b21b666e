"""The mechanics of arms and body, without the controller."""

from math import cos, exp, radians, sin
from random import Random

import pytest

from control.parameters.arm_mass import GRAVITY_M_S2, ArmMass
from control.records import Joints
from simulation.body.plant import END_STOPS_RAD, STEP_S, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.carriage import Carriage
from simulation.mud.clay import ADHESION, MUDS, Clay, rate_factor
from simulation.mud.disturbances import LAB, Disturbances
from simulation.mud.flipper_contact import NO_CONTACT, ArmMotion, ContactForce, FlipperContact
from simulation.mud.ground_contact import Ground
from simulation.mud.rigid_plate import Attitude
from simulation.mud.track import Track
from simulation.mud.unevenness import Ridges
from tests.control.synthetic_states import NO_TORQUE

TRACK = Track([(1.0, MUDS["48.5"])])
MASS = ArmMass()
WITHOUT_FRICTION = PlantParameters(joint_friction_nm_s=0.0)
DRY = PlantParameters(joint_friction_nm_s=0.0, joint_coulomb_nm=0.02, arm_mass=ArmMass(arm_mass_kg=0.0))
INERTIAS_KG_M2 = (MASS.sweep_inertia_kg_m2, MASS.adduction_inertia_kg_m2)


class ConstantThrust(FlipperContact):
    """A contact with mud that always pushes with the same force."""

    thrust_n = 0.0

    def step(
        self,
        dt_s: float,
        ground: Ground,
        motion: ArmMotion,
        attitude: Attitude,
        carriage: Carriage | None = None,
        edge_m: float = 0.0,
    ) -> ContactForce:
        return NO_CONTACT._replace(thrust_n=self.thrust_n)


def make_air_plant(parameters: PlantParameters = WITHOUT_FRICTION, thrust_n: float = 0.0) -> Plant:
    """Return a plant with level arms and without mud."""
    plant = Plant(parameters, TRACK)
    for arm in plant.arms:
        arm.adduction_rad = 0.0
        arm.contact = ConstantThrust(parameters.geometry)
        arm.contact.thrust_n = thrust_n / 2.0
    return plant


def run(plant: Plant, seconds: float, torques_nm: Joints[float] = NO_TORQUE, dt_s: float = STEP_S) -> Plant:
    for _ in range(round(seconds / dt_s)):
        plant.step(dt_s, torques_nm)
    return plant


# arms


def test_a_falling_swinging_arm_turns_height_into_speed() -> None:
    plant = make_air_plant()
    arm, weight_nm = plant.arms[0], MASS.arm_mass_kg * GRAVITY_M_S2 * MASS.center_of_mass_m
    arm.sweep_rad = 0.5
    for _ in range(5):
        run(plant, 0.03, dt_s=1e-5)
        rates_rad_s = (arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s)
        moving_j = sum(0.5 * j * rate * rate for j, rate in zip(INERTIAS_KG_M2, rates_rad_s, strict=True))
        assert moving_j == pytest.approx(-weight_nm * cos(arm.sweep_rad) * sin(arm.adduction_rad), rel=0.002)
    assert moving_j > 0.02 and arm.sweep_rad != 0.5


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_arms_stop_at_their_end_stops(sign: float) -> None:
    plant = run(make_air_plant(), 1.0, Joints(*[sign * 0.5] * 4))
    sweep_rad, adduction_rad = (sign * stop for stop in END_STOPS_RAD)
    assert plant.angles_rad == (sweep_rad, adduction_rad, sweep_rad, adduction_rad)
    assert plant.velocities_rad_s == NO_TORQUE


def test_dry_friction_slows_an_arm_down_evenly_until_it_stands() -> None:
    plant = make_air_plant(DRY)
    arm = plant.arms[0]
    arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s = 2.0, -2.0
    run(plant, 0.02)
    changes_rad_s = [0.02 * 0.02 / inertia_kg_m2 for inertia_kg_m2 in INERTIAS_KG_M2]
    assert plant.velocities_rad_s[:2] == pytest.approx((2.0 - changes_rad_s[0], -2.0 + changes_rad_s[1]))
    run(plant, 0.1)
    assert plant.velocities_rad_s == NO_TORQUE
    assert arm.sweep_rad == pytest.approx(2.0**2 / 2.0 * 0.0004 / 0.02, rel=0.03)  # v²/2a; a step is 1/40 of the stop


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_dry_friction_holds_a_joint_up_to_its_torque_and_then_opposes_its_motion(sign: float) -> None:
    plant = run(make_air_plant(DRY), 1.0, Joints(sign * 0.0199, sign * 0.0199, 0.0, 0.0))
    assert plant.angles_rad == NO_TORQUE
    run(plant, 0.01, Joints(sign * 0.03, sign * 0.03, 0.0, 0.0))
    rates_rad_s = [sign * 0.01 * 0.01 / inertia_kg_m2 for inertia_kg_m2 in INERTIAS_KG_M2]
    assert plant.velocities_rad_s == pytest.approx((*rates_rad_s, 0.0, 0.0))


@pytest.mark.parametrize("side", [0, 1])
def test_one_flipper_alone_moves_and_pushes(side: int) -> None:
    plant = make_air_plant()
    contact = plant.arms[side].contact
    assert isinstance(contact, ConstantThrust)
    contact.thrust_n = 20.0
    run(plant, 0.1, Joints(0.01, 0.06, 0.0, 0.0) if side == 0 else Joints(0.0, 0.0, 0.01, 0.06))
    own_rad, other_rad = (plant.angles_rad[2 * flipper : 2 * flipper + 2] for flipper in (side, 1 - side))
    assert own_rad[0] > 0.0 == other_rad[0]
    assert own_rad[1] > 0.0 > other_rad[1]  # the other one falls
    assert plant.body_m > 0.01


# the body


def test_the_body_slides_under_a_thrust_above_its_drag_at_the_speed_that_balances() -> None:
    thrust_n = 2.5 + 6.0 * 0.3 + rate_factor(0.3) * MUDS["48.5"].lateral_n(0.02, 0.015)
    plant = run(make_air_plant(thrust_n=thrust_n), 5.0)
    assert plant.body_m_s == pytest.approx(0.3, rel=0.01)
    assert plant.body_m > 0.5


# arms and body in mud


def test_unpowered_flippers_rest_on_the_mud_and_the_body_stays() -> None:
    plant = run(Plant(PlantParameters(), TRACK), 2.0)
    depth_m = plant.parameters.geometry.depth_m(*plant.angles_rad[:2])
    assert 0.0 < depth_m < 0.01
    assert abs(plant.body_m) < 0.005


def row(plant: Plant, dt_s: float = STEP_S) -> list[float]:
    """Make a stroke down, back, up and forward with prescribed torques; return body and angles at the end of each."""
    ends = []
    for sweep_nm, lift_nm, seconds in ((0.0, -0.3, 0.4), (-0.5, -0.3, 0.25), (0.0, 0.6, 0.3), (0.1, 0.05, 0.3)):
        run(plant, seconds, Joints(sweep_nm, lift_nm, sweep_nm, lift_nm), dt_s)
        ends += [plant.body_m, *plant.angles_rad]
    return ends


@pytest.mark.parametrize("free_body", [False, True])
def test_a_quarter_of_the_step_gives_the_same_push(free_body: bool) -> None:
    coarse, fine = (row(Plant(PlantParameters(free_body=free_body), TRACK), dt_s) for dt_s in (STEP_S, STEP_S / 4.0))
    assert coarse[5] > 0.002 and fine[5] == pytest.approx(coarse[5], rel=0.03)
    assert fine[6:10] == pytest.approx(coarse[6:10], abs=0.002)
    assert coarse[6:8] == coarse[8:10]  # left and right are alike


@pytest.mark.parametrize(("disturbances", "free_body"), [(Disturbances(), False), (LAB, False), (Disturbances(), True)])
def test_a_reset_brings_everything_back(disturbances: Disturbances, free_body: bool) -> None:
    plant = Plant(PlantParameters(disturbances=disturbances, free_body=free_body), TRACK, Random(3))
    first = row(plant)
    assert row(plant) != first
    plant.reset()
    assert row(plant) == first


def test_the_flippers_have_histories_of_their_own_and_a_seed_repeats_them() -> None:
    plants = [Plant(PlantParameters(disturbances=LAB), TRACK, Random(seed)) for seed in (3, 3, 4)]
    for plant in plants:
        row(plant)
    first, second, third = ([(a.surface_m, a.history.clinging_n) for a in plant.arms] for plant in plants)
    assert first == second
    assert len({*first, *third}) == 4
    assert all(clinging_n > 0.0 for _, clinging_n in first)


def test_an_arm_starts_with_its_edge_on_the_mud_that_it_meets_and_feels_it_from_there_on() -> None:
    plant = Plant(PlantParameters(disturbances=Disturbances(surface_sd_m=0.003)), TRACK, Random(3))
    for arm, surface_m in zip(plant.arms, (-0.001, 0.003), strict=True):
        assert arm.surface_m != 0.0
        depth_m = plant.parameters.geometry.depth_m(arm.sweep_rad, arm.adduction_rad)
        assert depth_m == pytest.approx(arm.surface_m)
        arm.adduction_rad = plant.parameters.geometry.adduction_rad(0.0, 0.0)  # the lower corner is at 1.5 mm
        arm.adduction_velocity_rad_s = -0.1
        arm.history.surface_m = arm.history._next_surface_m = surface_m
    plant.step(STEP_S, NO_TORQUE)
    left, right = plant.arms
    assert left.force.upward_n > 0.0
    assert right.force == NO_CONTACT


def test_an_arm_reports_the_remoulded_clay_under_its_flipper() -> None:
    parameters = PlantParameters(disturbances=Disturbances(remoulding=1.0), fixed_base=True)
    plant, strengths_pa = Plant(parameters, Track([(9.0, Clay("any", 1000.0))])), []
    for _ in range(3):
        run(plant, 0.3, Joints(0.0, -0.3, 0.0, -0.3))
        strengths_pa.append(plant.arms[0].ground.sticking_pa(0.0) / ADHESION)
        run(plant, 0.3, Joints(0.0, 0.6, 0.0, 0.6))
    assert strengths_pa == pytest.approx([500.0 + 500.0 * exp(-0.4 * earlier) for earlier in range(3)])


def test_the_clay_is_the_one_where_the_flipper_is_not_where_the_body_is() -> None:
    plant = Plant(PlantParameters(), Track([(0.05, MUDS["48.5"]), (1.0, MUDS["53.1"])]))
    plant.arms[0].sweep_rad, plant.arms[1].sweep_rad = radians(30.0), radians(-30.0)
    plant.step(STEP_S, NO_TORQUE)
    assert [arm.ground for arm in plant.arms] == [MUDS["53.1"], MUDS["48.5"]]


def test_an_arm_that_is_put_back_on_ridges_lies_on_the_mud_below_it() -> None:
    plant = Plant(PlantParameters(), Track([(1.0, MUDS["48.5"])], ridges=Ridges(0.01, 0.2)))
    arm, body_m = plant.arms[0], 0.046
    arm.sweep_rad, arm.adduction_rad = 1.0, 0.5  # over a trough; straight out there is a crest
    arm.step(STEP_S, body_m, 0.0, 0.0, 0.0)
    arm.put_back(body_m)
    edge_m = arm.parameters.geometry.depth_m(arm.sweep_rad, arm.adduction_rad)
    assert edge_m == pytest.approx(plant.track.surface_m(body_m)) == pytest.approx(-0.01, abs=1e-4)
