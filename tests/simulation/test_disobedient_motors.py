"""A motor that does not obey damping, or a pose held too stiffly, ends in a fault soon; a gentle push does not.

Without the monitors of the motion an inverted motor received 20 J and reached 97 rad/s. The fault matrix
(verification/faults) has a disobedient motor in every phase of a stride.
"""

from dataclasses import replace
from random import Random

import pytest

from control.modes import Mode, Request
from control.rate import PERIOD_S
from simulation.harness.joint_energy import JointEnergy
from verification.faults.failing_robot import FaultBench
from verification.faults.phases import bench_for, enter_phase


def made(phase: str) -> FaultBench:
    random = Random(f"{phase} 1")
    bench = bench_for(phase, random)
    enter_phase(bench, phase, random)
    return bench


def energy_of(bench: FaultBench) -> JointEnergy:
    return JointEnergy(bench.robot, bench.loop.configuration.joint_ranges)


def test_damping_with_an_inverted_motor_ends_before_the_joint_is_fast() -> None:
    bench = made("swing")
    with bench.drive_changed("left_adduction", commutation_error_deg=180.0):
        energy = energy_of(bench)
        bench.fail("left_sweep.position", "off", 0.01)  # another fault causes damping
        assert bench.run_until(lambda: bench.loop.mode is Mode.FAULT, 1.0)
    assert energy.peak_speed_rad_s < 30.0 and energy.energy_j < 0.3


@pytest.mark.parametrize("stiffness_nm_rad", [50.0, 200.0])
def test_a_pose_held_too_stiffly_ends_in_a_fault(stiffness_nm_rad: float) -> None:
    bench = made("stopping")
    controller = bench.loop.controller
    controller.gains = replace(
        controller.gains, sweep_stiffness_nm_rad=stiffness_nm_rad, adduction_stiffness_nm_rad=stiffness_nm_rad
    )
    energy = energy_of(bench)
    assert bench.run_until(lambda: bench.loop.mode is Mode.FAULT, 3.0)
    assert energy.energy_j < 1.0


def test_a_gentle_push_and_a_stop_cause_no_fault() -> None:
    """The push is 0.3 N·m for a quarter of a second in each direction."""
    bench = made("hold")
    arm = bench.robot.plant.arms[0]
    step_rad_s = 0.3 / arm.parameters.arm_mass.sweep_inertia_kg_m2 * PERIOD_S
    for sign in (1.0, -1.0):
        for _ in range(95):
            arm.sweep_velocity_rad_s += sign * step_rad_s
            bench.step()
    bench.loop.request(Request.STOP, bench.now_s)
    bench.run_for(0.5)
    assert bench.loop.mode is Mode.HOLD and bench.loop.fault is None
