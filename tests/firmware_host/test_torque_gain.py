"""A motor whose true torque constant is wrong, and a zero that shifts at a restart, by the truth of the plant."""

from dataclasses import replace
from random import Random

import pytest

from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from control.records import JOINTS
from drivers.fault_injection.failure_table import FAILURE_MODES
from simulation.devices.foreign_master import ForeignMaster
from simulation.harness.joint_energy import JointEnergy
from simulation.harness.lockstep import drives_of, plant_of
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB, NONE, Disturbances, drive_changes
from simulation.mud.track import Track
from tests.copied_robots import copy_of
from verification.faults.failing_robot import FailingRobot
from verification.faults.injection import inject
from verification.faults.phases import real_configuration

TRACK = Track([(5.0, Clay("2 kPa", 2000.0))])
STRIDE_S = 1.65  # at a depth of 3 cm
ROWS = {mode.kind: mode for mode in FAILURE_MODES}


def walk(disturbances: Disturbances, drive: str = "odrive") -> FailingRobot:
    """Return a robot in its second stride."""
    configuration = real_configuration(drive)
    drives = drives_of(configuration, **drive_changes(disturbances))
    robot = FailingRobot(configuration, TRACK, plant=plant_of(configuration, disturbances), drives=drives)
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=False))
    assert robot.run_until(lambda: robot.loop.controller.target.stride == 1, 6.0)
    return robot


@pytest.fixture(scope="module")
def walking() -> dict[str, FailingRobot]:
    return {"clean": walk(NONE), "lab": walk(LAB), "mit": walk(NONE, "mit")}


@pytest.mark.parametrize(
    ("ground", "joint", "kind", "strides", "most_j"),  # by more than a right motor
    [
        ("clean", "left_sweep", "torque constant x 0.2", 1, 0.5),
        ("clean", "right_adduction", "torque constant x 0.5", 3, 0.5),
        ("clean", "left_sweep", "torque constant x 2", 3, 0.5),
        ("clean", "right_adduction", "torque constant x 5", 1, 0.75),
        ("lab", "left_sweep", "torque constant x 4", 2, 0.5),
        ("lab", "right_adduction", "torque constant x 4", 2, 0.5),
        ("mit", "right_adduction", "torque constant x 2", 3, 0.5),
        ("mit", "left_sweep", "torque constant x 5", 1, 0.75),
    ],
)
def test_a_wrong_torque_constant_ends_the_walk_before_its_motor_did_much_work(
    walking: dict[str, FailingRobot], ground: str, joint: str, kind: str, strides: int, most_j: float
) -> None:
    robot, right = copy_of(walking[ground]), copy_of(walking[ground])
    works = [JointEnergy(each.robot, each.loop.configuration.joint_ranges) for each in (robot, right)]
    with inject(robot, ROWS[kind], joint):
        assert robot.run_until(lambda: robot.loop.mode not in ENERGISED, (strides + 0.2) * STRIDE_S)
    right.run_until(lambda: right.now_s >= robot.now_s, 10.0)
    index = robot.index_of(joint)
    assert works[0].joints[index].energy_j <= works[1].joints[index].energy_j + most_j


def test_a_loop_that_wakes_up_late_makes_no_permitted_torque_constant_wrong(walking: dict[str, FailingRobot]) -> None:
    robot, chance = copy_of(walking["mit"]), Random(1)
    for joint in JOINTS:
        robot.change_drive(joint, torque_constant_error=0.5)
    names = set()
    for _ in range(round(2.5 * STRIDE_S / robot.period_s)):
        robot.late_s = 0.9 * robot.period_s * (chance.random() < 0.5)
        robot.step()
        names |= {fault.name for fault in robot.loop.faults.begun}
    assert robot.loop.mode is Mode.WALKING and "torque_gain" not in names


@pytest.mark.parametrize(("ground", "boot_s"), [("clean", 0.02), ("mit", 0.1), ("clean", 1.0)])
def test_a_zero_that_shifted_at_a_restart_waits_for_an_operator(
    walking: dict[str, FailingRobot], ground: str, boot_s: float
) -> None:
    robot, mode = copy_of(walking[ground]), ROWS["restarted with another zero"]
    with inject(robot, replace(mode, act=("restart_shifted", 0.5, boot_s)), "left_sweep"):
        robot.run_for(boot_s + 3.0)
    for _ in range(2):
        robot.loop.request(Request.CLEAR, robot.now_s)
        robot.run_for(1.5)
    assert robot.loop.mode is Mode.IDLE and robot.loop.request(Request.ARM, robot.now_s)
    assert "zero_shifted" in {fault.name for fault in robot.loop.faults.present}
    for zero in robot.loop.fault_monitor.zeros:
        zero.confirm()
    robot.loop.request(Request.CLEAR, robot.now_s)
    robot.run_for(1.0)
    assert robot.loop.request(Request.ARM, robot.now_s) is None


def test_a_rare_set_point_beyond_the_limit_is_another_programs(walking: dict[str, FailingRobot]) -> None:
    robot = copy_of(walking["clean"])
    robot.robot.foreign_masters.append(ForeignMaster(robot.drive("left_sweep"), 1.0, every=60, heard=False))
    assert robot.run_until(lambda: robot.loop.mode not in ENERGISED, 63 * robot.period_s)
    assert "setpoint_mismatch" in {fault.name for fault in robot.loop.faults.present}
