"""The simulated robot as a process of its own, which records in every step of its time what its motors do.

A motor drives its joint while its drive follows torque commands and the torque is not zero. Once the drive does not, a
torque against the motion only takes energy from the joint, as that of shorted windings does; any other still drives.
"""

import signal
import sys
from argparse import ArgumentParser
from pathlib import Path
from struct import Struct
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from control.records import Torques
from firmware_host.configuration.loading import load_configuration
from simulation.harness.peer import Peer, take_precedence, track_of
from simulation.harness.robot import SimulatedRobot
from simulation.harness.world import World
from simulation.mud.clay import MUDS

RECORD = "motors.bin"  # next to the configuration
ROW = Struct("<d??")
COLUMNS = np.dtype([("stamp_s", "<f8"), ("follows", "?"), ("drives", "?")])  # any of the motors


class MotorRecord:
    """Owns the file, to which a row goes at once: its process is killed while others read."""

    def __init__(self, robot: SimulatedRobot, file: BinaryIO) -> None:
        self._robot = robot
        self._file = file
        self._velocities_rad_s = self._measured_rad_s()

    def add_step(self, step_s: float, torques: Torques) -> None:
        """Record a step by the velocities before it, to which the drives have reacted."""
        follows = [drive.energised for drive in self._robot.drives]
        drives = [
            torque_nm != 0.0 and (following or not torque_nm * velocity_rad_s < 0.0)
            for torque_nm, following, velocity_rad_s in zip(torques, follows, self._velocities_rad_s, strict=True)
        ]
        self._file.write(ROW.pack(self._robot.now_s, any(follows), any(drives)))
        self._velocities_rad_s = self._measured_rad_s()

    def _measured_rad_s(self) -> list[float]:
        arms = self._robot.plant.arms
        return [each for arm in arms for each in (arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s)]


def read_record(folder: Path, from_s: float) -> npt.NDArray[Any]:
    """Return the rows since a time on the monotonic clock."""
    rows = np.fromfile(folder / RECORD, COLUMNS)
    return rows[rows["stamp_s"] > from_s]


def main() -> int:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--config", type=Path, required=True)
    path = parser.parse_args().config
    configuration = load_configuration(path)
    peer = Peer(configuration, World(track_of(list(MUDS))), seed=1)
    signal.signal(signal.SIGTERM, peer.end)
    take_precedence(configuration.loop.cpu)
    with open(path.with_name(RECORD), "wb", buffering=0) as file:
        peer.robot.observers.append(MotorRecord(peer.robot, file).add_step)
        peer.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
