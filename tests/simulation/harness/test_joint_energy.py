"""The energy that motors put into joints equals the kinetic energy of the joints."""

from dataclasses import replace

import pytest

from control.parameters.arm_mass import ArmMass
from control.records import Joints
from experiments.robot.lockstep_robot import simulated_configuration
from simulation.harness.joint_energy import JointEnergy, JointWork
from simulation.harness.lockstep import Lockstep, plant_of
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

INERTIA_KG_M2 = 0.0004
RAISED_RAD = 1.0


def make_weightless_robot() -> tuple[Lockstep, JointEnergy]:
    """Make a robot with raised arms that neither gravity nor friction moves."""
    configuration = replace(simulated_configuration(), arm=ArmMass(arm_mass_kg=0.0))
    track = Track([(1.0, next(iter(MUDS.values())))])
    plant = plant_of(configuration, fixed_base=True, joint_friction_nm_s=0.0)
    lockstep = Lockstep(configuration, track, plant=plant)
    for arm in lockstep.robot.plant.arms:
        arm.adduction_rad = RAISED_RAD
    return lockstep, JointEnergy(lockstep.robot, configuration.joint_ranges)


def push(lockstep: Lockstep, energy: JointEnergy, torque_nm: float, steps: int) -> None:
    plant = lockstep.robot.plant
    for _ in range(steps):
        torques_nm = Joints(torque_nm, 0.0, 0.0, 0.0)
        plant.step(0.001, torques_nm)
        for observe in lockstep.robot.observers:
            observe(0.001, torques_nm)


def test_energy_of_a_free_joint_is_its_kinetic_energy() -> None:
    lockstep, energy = make_weightless_robot()
    energy.begin()
    push(lockstep, energy, 0.05, 100)
    speed_rad_s = lockstep.robot.plant.velocities_rad_s[0]
    joint = energy.joints[0]
    assert joint.peak_speed_rad_s == speed_rad_s == pytest.approx(12.5)
    assert joint.energy_j == pytest.approx(0.5 * INERTIA_KG_M2 * speed_rad_s**2, rel=0.02)
    assert energy.energy_j == joint.energy_j
    assert energy.joints[2].energy_j == 0.0


def test_a_motor_that_pushes_against_its_stop_does_no_work_and_is_seen_there() -> None:
    lockstep, energy = make_weightless_robot()
    push(lockstep, energy, 0.5, 2000)
    assert energy.joints[0].pushed_s > 1.9
    assert energy.joints[0].energy_j < 0.9  # 0.5 N·m over the path to the stop at 100°
    assert energy.beyond_rad == pytest.approx(1.745 - 1.047, abs=0.01)
    energy.begin()
    assert energy.beyond_rad == energy.pushed_s == energy.energy_j == 0.0


def test_earlier_braking_hides_no_later_energy() -> None:
    joint = JointWork()
    for work_j in (-2.0, 1.0, -0.5, 0.7):
        joint.add(work_j)
    assert joint.work_j == pytest.approx(-0.8)
    assert joint.energy_j == pytest.approx(1.2)
