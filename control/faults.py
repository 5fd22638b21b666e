"""Faults as data: what can go wrong, how hard the robot reacts, and when it counts as over.

Every kind stands once in the table of fault_kinds.py. The modes know reactions only, never single faults: the worst
reaction wins. What a person reads (the sentence, what to do) and what the machine obeys are in the same record.
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import NamedTuple


class Reaction(IntEnum):
    """From mild to hard; of several the largest number counts."""

    NONE = 0  # it only stands against arming
    WARN = 1  # it is told and logged, nothing else
    HOLD = 2  # a walk ends where it is: the measured pose is held
    SOFT_STOP = 3  # flippers are raised, for 3 s at most, then the drives go idle
    DAMPING = 4  # no stiffness, only damping, until the joints are at rest, then the drives go idle
    DRIVES_IDLE = 5  # at once


class Blocks(IntEnum):
    """Whether a fault stands against arming."""

    NO = 0
    UNLESS_FORCED = 1
    ALWAYS = 2


class Clears(Enum):
    """When a fault that met a robot with torque on is over. Where torque was off, it ends with its cause."""

    WHEN_GONE = "when its cause has been gone for a while"
    BY_HAND = "by 'mudskipper clear', once its cause is gone"
    BY_RESTART = "by a restart of the daemon: it is a bug"


class FaultKind(NamedTuple):
    name: str
    check: str  # the line of `mudskipper check` that it belongs to
    reaction: Reaction
    blocks: Blocks
    clears: Clears
    bound_ticks: int  # from the cause to the reaction, at the default bounds
    meaning: str
    what_to_do: str
    latches_idle: bool = False  # it is not over by itself where torque was off either


class Fault(NamedTuple):
    """One that is there. `subject` is the joint, the bus or nothing."""

    kind: FaultKind
    subject: str
    message: str

    @property
    def name(self) -> str:
        return self.kind.name

    @property
    def advice(self) -> str:
        """What happened, and what to do."""
        to_do = self.kind.what_to_do
        return f"{self.message} {to_do[:1].upper()}{to_do[1:]}."

    @property
    def check(self) -> str:
        """Identity of its line in `mudskipper check`."""
        return f"{self.kind.check}.{self.subject}" if self.subject else self.kind.check
