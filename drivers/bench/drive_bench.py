"""The interface of one protocol to the bench: how its drives are found. drivers/drive_types.py lists the protocols.

A type of drive without an entry there cannot be searched for.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol

from drivers.bench.bench_port import BenchPort
from drivers.can.frames import Frame


class FoundDrive(NamedTuple):
    """One drive that answers on a bus. Empty texts are not known."""

    type: str
    node_id: int
    hardware: str = ""  # or the motor's model
    firmware: str = ""
    serial_number: str = ""
    problem: str = ""  # why this program cannot use it as it is


class DriveBench(Protocol):
    """How the drives of one protocol are found."""

    @property
    def is_fd(self) -> bool:
        """Whether its frames are CAN FD."""

    @property
    def disturbs(self) -> str:
        """Why its questions may disturb drives of other protocols; empty where they do not."""

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        """Returns the ids of drives that send by themselves."""

    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        """Asks every id, without a frame that could command torque. Ids that were `heard` are found in any case.

        Two drives that answer under one id are two entries.
        """
