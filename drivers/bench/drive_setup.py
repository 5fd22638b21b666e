"""The interface of one drive to the bench while its settings are compared, written and stored.

A setting is a number under the drive's own name, in the drive's own unit. Writing changes the drive's memory alone;
storing makes it last. A type of drive that can do neither says so in `cannot`.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import inf
from struct import Struct
from typing import Any, NamedTuple

from drivers.bench.bench_port import BenchPort
from drivers.can.frames import MalformedMessageError

WATCHDOG_S = 0.1  # the time-out that is wanted, where the configuration allows it
SAME_FRACTION = 1e-4  # of a number that a drive keeps as binary32, or prints with six digits


class FoundDrive(NamedTuple):
    """One drive that answers on a bus. Empty texts are not known."""

    type: str
    node_id: int
    hardware: str = ""  # or what is known of the motor's model
    firmware: str = ""
    serial_number: str = ""
    problem: str = ""  # why this program cannot use it as it is
    model: str = ""  # of the motor, as the configuration names it: one whose ranges the drive has
    model_problem: str = ""  # why no model has its ranges; the configuration may state them


class CannotReadError(Exception):
    """This setting cannot be read or written over CAN as things are; the message says why, and what helps."""


class Setting(NamedTuple):
    """One setting, what the configuration wants it to be, and within which bounds it is accepted."""

    key: str
    wanted: float
    least: float
    most: float
    source: str  # of the wanted value: a key of the configuration, or a guide
    read_only: str = ""  # why it is never written; empty where it is

    def accepts(self, value: float) -> bool:
        return self.least <= value <= self.most


def exactly(key: str, wanted: float, source: str, read_only: str = "", fraction: float = SAME_FRACTION) -> Setting:
    """Return a setting that must be equal to `wanted`, up to a fraction of it."""
    margin = fraction * abs(wanted)
    return Setting(
        key=key, wanted=wanted, least=wanted - margin, most=wanted + margin, source=source, read_only=read_only
    )


def watchdog(key: str, longest_s: float) -> Setting:
    """Return the setting of a time-out in seconds."""
    return Setting(
        key=key,
        wanted=min(WATCHDOG_S, longest_s),
        least=0.001,
        most=longest_s,
        source="faults.longest_watchdog_s",
    )


def same(value: float, expected: float) -> bool:
    """Return whether a drive has taken a value; NaN is one, of a watchdog that is off, and so is infinity, no limit."""
    if expected != expected:
        return value != value
    return value == expected or abs(value - expected) <= SAME_FRACTION * abs(expected) < inf


def encoded(layout: Struct, key: str, value: float) -> bytes:
    """Encode a number by its type; raises CannotReadError for one that the type does not have."""
    try:
        return layout.pack(value if layout.format == "<f" else round(value))
    except (MalformedMessageError, OverflowError, ValueError):
        raise CannotReadError(f"{key} cannot be {value:g}") from None


class DriveSetup(ABC):
    """One drive, under the id of the configuration, whose settings cannot be read unless a protocol says how.

    Everything raises NoAnswerError where the drive does not answer.
    """

    cannot = ""  # why its settings can be neither read nor written over CAN; empty where they can
    stored = ""  # what proves that settings last, once `save` has returned; for people

    @abstractmethod
    def identify(self) -> FoundDrive:
        """Ask for what is known of this drive; it comes before everything else."""

    def activity(self) -> str:
        """Return what the drive does, where it is not idle; empty for an idle one."""
        return ""

    def settings(self) -> Sequence[Setting]:
        return ()

    def read(self, key: str) -> float:
        raise CannotReadError(self.cannot)

    def write(self, key: str, value: float) -> None:
        """Write to the drive's memory. Raises CannotReadError."""
        raise CannotReadError(self.cannot)

    def save(self) -> None:
        """Store all settings, and return once the drive answers again."""
        raise CannotReadError(self.cannot)


class AskedSetup(DriveSetup):
    """A drive that is asked over one bus; `parameters` are those of its type."""

    def __init__(self, port: BenchPort, parameters: Any, longest_watchdog_s: float) -> None:
        self._port = port
        self._parameters = parameters
        self._longest_watchdog_s = longest_watchdog_s


class NoSetup(DriveSetup):
    """A drive whose settings cannot be read over CAN, for a reason."""

    def __init__(self, found: FoundDrive, reason: str) -> None:
        self._found = found
        self.cannot = reason

    def identify(self) -> FoundDrive:
        return self._found
