"""The interface of one protocol to the bench: how its drives are found, and how one is set up.

A type of drive whose `DriveType.bench` is None can be neither found nor set up.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, NamedTuple

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_setup import DriveSetup, FoundDrive
from drivers.can.frames import Frame
from drivers.drive import WatchdogEndpoints


class SetupFacts(NamedTuple):
    """What is known of one drive before it is asked."""

    parameters: Any  # those of the drive's type
    longest_watchdog_s: float
    endpoints: Sequence[WatchdogEndpoints] = ()
    documents: Sequence[Any] = ()  # files of the makers, read as JSON, with the numbers of parameters


class DriveBench(ABC):
    """How the drives of one protocol are found and set up."""

    is_fd: ClassVar[bool] = False  # its frames are CAN FD
    disturbs: ClassVar[str] = ""  # why its questions may disturb drives of other protocols; empty where they do not

    def ids_heard(self, frames: Iterable[Frame]) -> set[int]:
        """Return the ids of drives that send by themselves; none where they only answer."""
        return set()

    @abstractmethod
    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        """Ask every id, without a frame that could command torque. Ids that were `heard` are found in any case.

        Two drives that answer under one id are two entries.
        """

    @abstractmethod
    def open_setup(self, port: BenchPort, facts: SetupFacts) -> DriveSetup:
        """Return the set-up of one drive; raises ValueError for a document that is none of the makers'."""
