"""The record of the motors marks torque that drives a joint, and none that only brakes it."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from control.records import Joints
from verification.stress.daemon_kills import end_s
from verification.stress.recorded_robot import RECORD, MotorRecord, read_record


class OneFlipper:
    """Has what the record reads of a simulated robot."""

    def __init__(self, follows: bool, velocity_rad_s: float) -> None:
        self.now_s = 0.0
        self.drives = [SimpleNamespace(energised=follows), SimpleNamespace(energised=False)]
        arm = SimpleNamespace(sweep_velocity_rad_s=velocity_rad_s, adduction_velocity_rad_s=0.0)
        self.plant = SimpleNamespace(arms=[arm])


def recorded(folder: Path, robot: Any, torque_nm: float) -> tuple[bool, bool]:
    """Return whether a motor follows and whether one drives its joint, in one step."""
    with open(folder / RECORD, "wb", buffering=0) as file:
        record = MotorRecord(robot, file)
        robot.now_s = 1.0
        record.add_step(0.001, Joints(torque_nm, 0.0))
    (row,) = read_record(folder, from_s=0.5)
    return bool(row["follows"]), bool(row["drives"])


@pytest.mark.parametrize(("torque_nm", "drives"), [(0.0, False), (0.3, True), (-0.3, True)])
def test_any_torque_of_a_drive_that_follows_commands_drives_its_joint(
    tmp_path: Path, torque_nm: float, drives: bool
) -> None:
    assert recorded(tmp_path, OneFlipper(follows=True, velocity_rad_s=2.0), torque_nm) == (True, drives)


@pytest.mark.parametrize(("velocity_rad_s", "drives"), [(2.0, True), (0.0, True), (-2.0, False)])
def test_without_commands_only_a_torque_against_the_motion_brakes(
    tmp_path: Path, velocity_rad_s: float, drives: bool
) -> None:
    assert recorded(tmp_path, OneFlipper(follows=False, velocity_rad_s=velocity_rad_s), 0.3) == (False, drives)


def test_the_end_of_torque_is_that_of_the_last_marked_step(tmp_path: Path) -> None:
    with open(tmp_path / RECORD, "wb", buffering=0) as file:
        robot: Any = OneFlipper(follows=True, velocity_rad_s=0.0)
        record = MotorRecord(robot, file)
        for step, torque_nm in enumerate((0.3, 0.3, 0.0, 0.3, 0.0)):
            robot.now_s = 0.001 * step
            record.add_step(0.001, Joints(torque_nm, 0.0))
        file.write(b"\0")  # a row that is being written
    assert end_s(read_record(tmp_path, from_s=0.0005)["drives"]) == pytest.approx(0.003)
    assert end_s(read_record(tmp_path, from_s=0.0035)["drives"]) == 0.0
