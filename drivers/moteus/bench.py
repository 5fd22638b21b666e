"""Finds moteus drives: by reading the registers of their identity at every id, which no drive takes for a command.

On a bus with drives of classic CAN, frames of CAN FD are errors. Source: docs/protocol/can.md and registers.md of
mjbots/moteus.
"""

from collections.abc import Iterable, Sequence
from typing import cast

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import SetupFacts
from drivers.bench.found_drive import FoundDrive
from drivers.can.frames import Frame
from drivers.moteus.identity import found_drive, is_reply, request
from drivers.moteus.parameters import LARGEST_ID, SMALLEST_ID, MoteusParameters
from drivers.moteus.settings import IDENTITY
from drivers.moteus.setup import MoteusSetup


class MoteusBench:
    """Implements DriveBench."""

    is_fd = True
    disturbs = "drives of classic CAN take its CAN FD frames for errors"

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        """A moteus sends nothing by itself."""
        return set()

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        answers = port.ask_all(request(node_id, IDENTITY) for node_id in range(SMALLEST_ID, LARGEST_ID + 1))
        found = (found_drive(frame) for frame in answers if is_reply(frame))
        return sorted({each for each in found if each is not None}, key=lambda each: (each.node_id, each.serial_number))

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> MoteusSetup:
        return MoteusSetup(port, cast(MoteusParameters, facts.parameters), facts.longest_watchdog_s)
