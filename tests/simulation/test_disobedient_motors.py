"""Motors that do not obey put only little energy into a joint before the drives go idle, in the whole program.

Without the monitors of the motion an inverted motor received 20 J and reached 97 rad/s, late commands let a joint
oscillate at its full torque as long as they were late (26 J in 8 s), and a robot with a frozen encoder walked on.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from random import Random

import pytest

from control.modes import ENERGISED, Mode, Request
from control.rate import PERIOD_S
from control.records import JOINTS
from simulation.harness.joint_energy import JointEnergy
from verification.faults.bench import FaultBench
from verification.faults.injectors import Injector, damped_against_command, drive_with, failing, jammed
from verification.faults.phases import bench_for, enter_phase

INVERTED = drive_with(commutation_error_deg=180.0)
FROZEN = drive_with(encoder_frozen=True)
LATE = failing("JOINT.command", "slow")


def made(phase: str, seed: int = 1) -> FaultBench:
    random = Random(f"{phase} {seed}")
    bench = bench_for(phase, random)
    enter_phase(bench, phase, random)
    return bench


def faults_of(bench: FaultBench) -> set[str]:
    return {fault.name for fault in bench.loop.faults.present}


@contextmanager
def measured(bench: FaultBench, inject: Injector, joint: str) -> Iterator[JointEnergy]:
    with inject(bench, joint):
        yield JointEnergy(bench.robot, bench.loop.configuration.joint_ranges)


@pytest.mark.parametrize(
    ("inject", "phase", "joint", "fault", "energy_j"),
    [
        (INVERTED, "insertion", "left_sweep", "joint_runaway", 0.3),
        (INVERTED, "stance", "right_adduction", "joint_runaway", 0.3),
        (LATE, "swing", "right_sweep", "setpoint_mismatch", 0.3),  # the set-points of older commands
        (FROZEN, "insertion", "right_adduction", "encoder_stuck", 0.6),
        (FROZEN, "swing", "left_sweep", "setpoint_mismatch", 0.6),  # clamped at a speed that is not reported
        (jammed, "swing", "left_sweep", "following_error", 0.3),
    ],
)
def test_a_motor_that_does_not_obey_puts_little_energy_into_its_joint(
    inject: Injector, phase: str, joint: str, fault: str, energy_j: float
) -> None:
    bench = made(phase)
    with measured(bench, inject, joint) as energy:
        assert bench.run_until(lambda: fault in faults_of(bench), 5.0)
        assert bench.run_until(lambda: bench.loop.mode not in ENERGISED, 3.2)
        bench.run_for(0.5)
    assert energy.joints[JOINTS.index(joint)].energy_j < energy_j
    assert energy.pushed_s < 0.05


def test_damping_with_an_inverted_motor_ends_before_the_joint_is_fast() -> None:
    bench = made("swing")
    with measured(bench, INVERTED, "left_adduction") as energy:
        bench.fail("left_sweep.position", "off", 0.01)  # another fault causes damping
        assert bench.run_until(lambda: bench.loop.mode is Mode.FAULT, 1.0)
    assert energy.peak_speed_rad_s < 30.0 and energy.energy_j < 0.3


def test_damping_ends_if_a_current_opposes_it() -> None:
    bench = made("hold")
    with damped_against_command(bench, "left_sweep"):
        assert bench.run_until(lambda: "damping_failed" in faults_of(bench), 0.2)
        assert bench.loop.mode is Mode.FAULT


@pytest.mark.parametrize("stiffness_nm_rad", [50.0, 200.0])
def test_a_pose_held_too_stiffly_ends_in_a_fault(stiffness_nm_rad: float) -> None:
    bench = made("stopping")
    controller = bench.loop.controller
    controller.gains = replace(
        controller.gains, sweep_stiffness_nm_rad=stiffness_nm_rad, adduction_stiffness_nm_rad=stiffness_nm_rad
    )
    energy = JointEnergy(bench.robot, bench.loop.configuration.joint_ranges)
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
