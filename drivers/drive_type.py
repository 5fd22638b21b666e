"""The interface of a drive type: one protocol, and what the rest of the program needs to know of it.

A protocol is a folder of drivers/ whose files have the same names in each: `codec` (bytes), `parameters` (its keys in
the configuration), `axis` (one drive as a joint), `settings` (what a drive reports of itself), `gate_table` (the frames
that may leave), `bench` and `setup` (finding and setting up drives), and `drive_type`, which joins them in a class
derived from `DriveType`. drivers/drive_types.py lists the types that exist.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from drivers.bench.drive_bench import DriveBench
from drivers.can.bus_load import FrameRate
from drivers.can.frames import Frame
from drivers.drive import DriveParameters, Outlet, WatchdogEndpoints
from drivers.drive_axis import DriveAxis
from drivers.transmit_gate import FrameKind, GateTable


class Span(NamedTuple):
    """Where a signal stands in a payload, and its bytes where the drive does not know it; None: it sends no message."""

    begin: int
    end: int
    absent: bytes | None


class FrameContent(NamedTuple):
    """The meaning of a frame in a drive's protocol."""

    node_id: int  # of the drive that sends it or is addressed
    is_command: bool = False  # a drive obeys it and never sends it
    signals: tuple[str, ...] = ()  # what it reports, the main one first: position, current, heartbeat, error, ...
    spans: Mapping[str, Span] = {}  # of these signals; one without a span is the whole payload


class DriveType(ABC):
    """One protocol, and the drives that speak it."""

    parameters: ClassVar[type[DriveParameters]]  # the record of the configuration's `[drive.JOINT]`
    axis: ClassVar[type[Any]]  # derived from DriveAxis; it is made of a joint's name, its parameters and an outlet
    command: ClassVar[FrameRate]  # that this program sends to each drive in every tick
    reports: ClassVar[tuple[FrameRate, ...]]  # that each drive sends cyclically, as the set-up instructions give it
    kind: ClassVar[FrameKind] = FrameKind()  # of the frames that this program sends; all drives of a bus need the same
    example_error: ClassVar[int] = 1  # flags on which the drive switches its torque off, for fault injection
    bench: ClassVar[DriveBench | None] = None  # finds and sets up drives; None where that needs the makers' tool

    def make_axis(
        self, joint: str, parameters: DriveParameters, outlet: Outlet, endpoints: Sequence[WatchdogEndpoints]
    ) -> DriveAxis:
        """Make one drive as a joint. `endpoints` are of interest to a protocol that reads a watchdog by number."""
        axis: DriveAxis = self.axis(joint, parameters, outlet)
        return axis

    @abstractmethod
    def identifiers(self, parameters: DriveParameters) -> frozenset[int]:
        """Return every arbitration id that this drive sends or obeys; with the bit FD for CAN FD frames."""

    @staticmethod
    @abstractmethod
    def gate_table(drive: Any) -> GateTable:
        """List everything that may leave for one drive, given its parameters of this type."""

    @abstractmethod
    def announces(self, node_id: int) -> Frame:
        """Return a frame that only a drive of this type sends under this id, by itself or when asked."""

    @abstractmethod
    def read_frame(self, frame: Frame) -> FrameContent | None:
        """Return the content of a frame by its id; None for frames of another kind than the protocol uses."""

    def query(self, node_id: int) -> Frame | None:
        """Return the frame that asks a drive for all signals; None where drives report by themselves."""
        return None

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Return frames that other programs may send while torque is on, by name: they must not feed a watchdog."""
        return {}

    def with_error(self, frame: Frame, flags: int, idle: bool) -> bytes:
        """Return the payload of a frame that reports errors, with these error flags added and the drive set to `idle`.

        A payload that cannot be decoded is returned unchanged.
        """
        return frame.data
