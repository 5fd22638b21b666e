"""A belt with play against the mechanics of two bodies that collide."""

from math import radians

import pytest

from control.parameters.arm_mass import ArmMass
from control.records import Joints
from simulation.body.belt import FRICTION_NM, STIFFNESS_NM_RAD, Belt
from simulation.body.plant import Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.disturbances import Disturbances
from simulation.mud.track import paper_track

PLAY_RAD = radians(1.0)
INERTIA_KG_M2 = 0.0004


class TwoBodies:
    """A rotor and an arm without friction, joined by a belt."""

    def __init__(self) -> None:
        self.belt = Belt(PLAY_RAD, INERTIA_KG_M2, friction_nm=0.0)
        self.arm_kg_m2 = INERTIA_KG_M2 - self.belt.rotor_kg_m2
        self.angle_rad = self.velocity_rad_s = 0.0

    def step(self, dt_s: float, motor_nm: float = 0.0) -> float:
        belt_nm = self.belt.transmit(dt_s, motor_nm, self.angle_rad, self.velocity_rad_s)
        self.velocity_rad_s += dt_s * belt_nm / self.arm_kg_m2
        self.angle_rad += dt_s * self.velocity_rad_s
        return belt_nm

    @property
    def energy_j(self) -> float:
        ahead_rad = abs(self.belt.angle_rad - self.angle_rad)
        stretch_rad = max(ahead_rad - PLAY_RAD / 2.0, 0.0)
        moving_j = self.belt.rotor_kg_m2 * self.belt.velocity_rad_s**2 + self.arm_kg_m2 * self.velocity_rad_s**2
        return 0.5 * (moving_j + STIFFNESS_NM_RAD * stretch_rad**2)


def test_motor_and_arm_turn_as_one_joint() -> None:
    """Behind the play, by the torque that accelerates the arm's part of the inertia."""
    bodies = TwoBodies()
    torques_nm = [bodies.step(0.001, 0.4) for _ in range(200)]
    arm_nm = 0.4 * bodies.arm_kg_m2 / INERTIA_KG_M2
    assert sum(torques_nm[100:]) / 100 == pytest.approx(arm_nm, rel=0.01)
    assert bodies.angle_rad == pytest.approx(0.5 * 0.4 / INERTIA_KG_M2 * 0.2**2, rel=0.02)
    assert bodies.belt.angle_rad - bodies.angle_rad == pytest.approx(PLAY_RAD / 2 + arm_nm / STIFFNESS_NM_RAD, rel=0.05)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_within_its_play_the_motor_turns_alone_and_the_belt_never_pulls_it_back(side: float) -> None:
    bodies = TwoBodies()
    torques_nm = [bodies.step(0.0001, side * 0.1) for _ in range(2000)]
    alone = next(index for index, torque_nm in enumerate(torques_nm) if torque_nm)
    assert alone * 0.0001 == pytest.approx((PLAY_RAD * bodies.belt.rotor_kg_m2 / 0.1) ** 0.5, rel=0.03)
    assert min(side * torque_nm for torque_nm in torques_nm) == 0.0


@pytest.mark.parametrize("dt_s", [0.0001, 0.001, 0.005])
def test_a_rattling_belt_gains_no_energy(dt_s: float) -> None:
    bodies = TwoBodies()
    bodies.belt.velocity_rad_s = 5.0
    energies_j = [bodies.energy_j for _ in range(round(1.0 / dt_s)) if bodies.step(dt_s) < 1e9]
    assert max(energies_j) <= 1.001 * 0.5 * bodies.belt.rotor_kg_m2 * 25.0


def test_a_rotor_that_is_left_alone_stops_within_its_play() -> None:
    belt = Belt(PLAY_RAD, INERTIA_KG_M2)
    belt.velocity_rad_s = 0.1
    stopping_s = 0.1 * belt.rotor_kg_m2 / FRICTION_NM
    for _ in range(round(2.0 * stopping_s / 0.0001)):
        assert belt.transmit(0.0001, 0.0, 0.0, 0.0) == 0.0
    assert belt.velocity_rad_s == 0.0
    assert belt.angle_rad == pytest.approx(0.1 * stopping_s / 2.0, rel=0.05)


def test_the_encoders_are_at_the_motors() -> None:
    """A torque holds the flipper from above: its motor is ahead by half of the play and the stretch of the belt."""
    mass = ArmMass()
    plant = Plant(PlantParameters(disturbances=Disturbances(play_deg=1.0), fixed_base=True), paper_track())
    arm = plant.arms[0]
    arm.adduction_rad = 0.1  # above the mud
    arm.belts[1].put(0.1)
    holding_nm = -mass.gravity_torques_nm(0.0, 0.1)[1]
    for _ in range(3000):
        _, _, motor_rad, motor_rad_s = arm.motors
        plant.step(0.001, Joints(0.0, holding_nm - 2.0 * (motor_rad - 0.1) - 0.02 * motor_rad_s, 0.0, 0.0))
    ahead_rad = arm.motors[2] - arm.adduction_rad
    assert ahead_rad == pytest.approx(PLAY_RAD / 2 + holding_nm / STIFFNESS_NM_RAD, rel=0.05)
