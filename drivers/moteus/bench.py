"""Finds moteus drives: by reading the registers of their identity at every id, which no drive takes for a command.

On a bus with drives of classic CAN, frames of CAN FD are errors. Source: docs/protocol/can.md and registers.md of
mjbots/moteus.
"""

from collections.abc import Sequence

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import DriveBench, SetupFacts
from drivers.bench.drive_setup import FoundDrive
from drivers.moteus.codec import command_frame
from drivers.moteus.parameters import LARGEST_ID, SMALLEST_ID
from drivers.moteus.settings import IDENTITY
from drivers.moteus.setup import MoteusSetup, found_drive


class MoteusBench(DriveBench):
    is_fd = True
    disturbs = "drives of classic CAN take its CAN FD frames for errors"

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        answers = port.ask_all(command_frame(node_id, IDENTITY) for node_id in range(SMALLEST_ID, LARGEST_ID + 1))
        found = {each for each in map(found_drive, answers) if each is not None}
        return sorted(found, key=lambda each: (each.node_id, each.serial_number))

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> MoteusSetup:
        return MoteusSetup(port, facts.parameters, facts.longest_watchdog_s)
