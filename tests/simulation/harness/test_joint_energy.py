"""The energy that motors put into joints equals the kinetic energy of the joints."""

from dataclasses import replace

import pytest

from control.parameters.arm_mass import ArmMass
from control.records import Joints
from experiments.robot.lockstep_robot import simulated_configuration
from simulation.harness.joint_energy import JointEnergy, JointWork
from simulation.harness.lockstep import Lockstep, plant_of
from simulation.mud.track import paper_track

INERTIA_KG_M2 = 0.0004


def pushed(torque_nm: float, steps: int) -> tuple[JointEnergy, float]:
    """Push the first joint of a robot with raised arms that neither gravity nor friction moves; return its speed."""
    configuration = replace(simulated_configuration(), arm=ArmMass(arm_mass_kg=0.0))
    plant_parameters = plant_of(configuration, fixed_base=True, joint_friction_nm_s=0.0)
    robot = Lockstep(configuration, paper_track(), plant=plant_parameters).robot
    for arm in robot.plant.arms:
        arm.adduction_rad = 1.0
    energy = JointEnergy(robot, configuration.joint_ranges)
    torques_nm = Joints(torque_nm, 0.0, 0.0, 0.0)
    for _ in range(steps):
        robot.plant.step(0.001, torques_nm)
        for observe in robot.observers:
            observe(0.001, torques_nm)
    return energy, robot.plant.velocities_rad_s[0]


def test_energy_of_a_free_joint_is_its_kinetic_energy() -> None:
    energy, speed_rad_s = pushed(0.05, 100)
    assert energy.peak_speed_rad_s == speed_rad_s == pytest.approx(12.5)
    assert energy.energy_j == pytest.approx(0.5 * INERTIA_KG_M2 * speed_rad_s**2, rel=0.02)
    assert (energy.joints[0].energy_j, energy.joints[2].energy_j) == (energy.energy_j, 0.0)


def test_a_motor_that_pushes_against_its_stop_does_no_work_and_is_seen_there() -> None:
    energy, _ = pushed(0.5, 2000)
    assert energy.joints[0].pushed_s > 1.9
    assert energy.joints[0].energy_j < 0.9  # 0.5 N·m over the path to the stop at 100°
    assert energy.beyond_rad == pytest.approx(1.745 - 1.047, abs=0.01)
    energy.begin()
    assert energy.beyond_rad == energy.pushed_s == energy.energy_j == 0.0


def test_earlier_braking_hides_no_later_energy() -> None:
    joint = JointWork()
    for work_j in (-2.0, 1.0, -0.5, 0.7):
        joint.add(work_j)
    assert (joint.work_j, joint.energy_j) == pytest.approx((-0.8, 1.2))
