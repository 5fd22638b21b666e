"""The interface of one protocol to the bench: how its drives are found, and how one is set up.

drivers/drive_types.py lists the protocols. A type of drive without an entry there can be neither found nor set up.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Protocol

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_setup import DriveSetup
from drivers.bench.found_drive import FoundDrive
from drivers.can.frames import Frame
from drivers.drive import DriveParameters, WatchdogEndpoints


class SetupFacts(NamedTuple):
    """What is known of one drive before it is asked."""

    parameters: DriveParameters
    longest_watchdog_s: float
    endpoints: Sequence[WatchdogEndpoints] = ()
    documents: Sequence[Any] = ()  # files of the makers, read as JSON, with the numbers of parameters


class DriveBench(Protocol):
    """How the drives of one protocol are found and set up."""

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

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> DriveSetup:
        """Raises ValueError for a document that is none of the makers'."""
