"""The drives that are found on the buses: where they are, what they are, and their own numbers."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from experiments.bench.measured_check import measure_check
from experiments.bench.test_rig import TestRig
from experiments.bench.wiring_check import CHECKS, ask_drives
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.configuration import Configuration

Changes = dict[tuple[str, ...], Any]
Identities = dict[str, dict[str, str | int]]  # by joint


def identify_drives(test_rig: TestRig) -> Identities:
    """Check the wiring, and return every drive. Raises BenchError with what is wrong."""
    for check in CHECKS:
        if problem := measure_check(test_rig, check).problem:
            raise BenchError(problem)
    numbered = {joint for joint, drive in test_rig.configuration.drive.items() if drive.serial_digits}
    asked = ask_drives(test_rig, lambda health: bool(health.serial_number) or health.joint not in numbered)
    health = {each.joint: each for each in asked}
    return {
        joint: {
            "bus": drive.bus,
            "node_id": drive.node_id,
            "type": drive.type,
            "model": getattr(drive, "model", ""),
            "serial_number": health[joint].serial_number,
            "firmware": health[joint].firmware,
        }
        for joint, drive in test_rig.configuration.drive.items()
    }


def calibration_records(configuration: Configuration, drives: Identities, joints: Iterable[str], date: str) -> Changes:
    """Return the keys that say for which drives these joints were calibrated."""
    changes: Changes = {}
    for joint in joints:
        number, drive = str(drives[joint]["serial_number"]), configuration.drive[joint]
        if number.strip("0"):  # one of zeros is none
            changes["drive", joint, "serial_number"] = number
            drive = replace(drive, serial_number=number)
        changes["drive", joint, "calibrated"] = {"date": date, "drive": drive.identity}
    return changes
