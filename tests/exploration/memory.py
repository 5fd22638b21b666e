"""Records of the search: the state on which the robot's future depends, and the events that may happen to it.

A `Memory` is read from the product's objects and restored into them, so this module knows their private fields.
"""

from enum import IntEnum
from typing import Any, NamedTuple

from control.fault_latch import FaultLatch, PresentFault
from control.faults import FaultKind
from control.modes import Mode, Request
from firmware_host.lease import Lease
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.socket_methods import Level
from tests.exploration.abstract_drives import PERIOD_S, DriveMemory, Event, Obedience

NOW_S = 1000.0  # of the last tick
CALL_S = NOW_S + PERIOD_S - 0.25  # when operators call
LATCH_PERIOD_S = 0.1  # a fault is over one tick after its cause


class Operator(IntEnum):
    ANNA = 0
    BEN = 1


CALLERS = {each: Caller(each, Peer(100 + each, 1000 + each, frozenset()), Level.DRIVE) for each in Operator}
OPERATORS = {str(caller): each for each, caller in CALLERS.items()}


class Call(NamedTuple):
    """One request of one operator, or the end of its connection."""

    operator: Operator
    method: str
    params: tuple[tuple[str, Any], ...] = ()

    @property
    def takes_over(self) -> bool:
        return ("take_over", True) in self.params

    def __str__(self) -> str:
        return f"{self.operator.name.lower()} {self.method} {dict(self.params) or ''}".rstrip()


class LeaseMemory(NamedTuple):
    holder: Operator | None = None
    remaining_s: float = 0.0
    lost: bool = False
    ousted: tuple[tuple[Operator, str], ...] = ()


class LatchedFault(NamedTuple):
    kind: FaultKind
    absent_ticks: int
    latched: bool


class Memory(NamedTuple):
    """The state on which the future depends, with all times relative to the last tick."""

    mode: Mode = Mode.BOOT
    mode_ticks: int = 0  # where a duration ends the mode
    pending: Request = Request.NONE
    forced: str = ""
    ending: bool = False
    clearing: bool = False
    moving: bool = False
    cut_short: bool = False
    faults: tuple[LatchedFault, ...] = ()
    lease: LeaseMemory = LeaseMemory()
    obedient: DriveMemory = DriveMemory()
    other: DriveMemory = DriveMemory(heard=False)


class World(NamedTuple):
    """The events of one tick."""

    faults: tuple[FaultKind, ...] = ()
    done: bool = False  # the strides, the raising, the damping or the move
    heartbeat: bool = True  # the heartbeat of the other drive arrives
    obedience: Obedience = Obedience.ALL  # of the other drive
    event: Event = Event.NONE


def restore_lease(lease: Lease, memory: LeaseMemory) -> None:
    lease.reset()
    if memory.holder is not None:
        lease.holder, lease.until_s = CALLERS[memory.holder], NOW_S + memory.remaining_s
    lease._lost = memory.lost
    lease._ousted = {CALLERS[each]: by for each, by in memory.ousted}


def lease_memory(lease: Lease, now_s: float) -> LeaseMemory:
    holder = None if lease.holder is None else OPERATORS[str(lease.holder)]
    remaining_s = max(lease.until_s - now_s, 0.0) if holder is not None and not lease._lost else 0.0
    ousted = tuple(sorted((OPERATORS[str(each)], by) for each, by in lease._ousted.items()))
    return LeaseMemory(holder, remaining_s, lease._lost, ousted)


def restored_latch(faults: tuple[LatchedFault, ...]) -> FaultLatch:
    latch = FaultLatch(LATCH_PERIOD_S)
    for kind, absent_ticks, latched in faults:
        latch._present[kind.value, ""] = PresentFault(kind.fault(), 0, -absent_ticks, latched)
    latch.worst = max(latch.present, key=lambda fault: fault.kind.reaction, default=None)
    return latch


def latched_faults(latch: FaultLatch) -> tuple[LatchedFault, ...]:
    present = latch._present.values()
    absent = latch._good_ticks + 1  # longer makes no difference
    faults = [
        LatchedFault(each.fault.kind, min(latch._tick - each.last_tick, absent), each.latched) for each in present
    ]
    return tuple(sorted(faults))
