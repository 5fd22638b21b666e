"""The promises of the robot for one tick and for one call, after any history.

A promise is a text and a condition on one edge of the graph that the search walks. Earlier events that still bind the
robot travel along as `Debts`, so that no promise relies on the code that it checks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from control.controller import DAMPING_S, SOFT_STOP_S
from control.faults import Blocks, Clears, FaultKind, Reaction
from control.modes import ENERGISED, MOVING, Mode, Request
from tests.exploration.abstract_drives import PERIOD_S
from tests.exploration.abstract_robot import AbstractRobot
from tests.exploration.memory import CALL_S, NOW_S, Call, Memory, Operator
from tests.mode_hardness import HARDNESS, MILDEST

LONGEST_TICKS = {
    Mode.STOPPING: round(SOFT_STOP_S / PERIOD_S) + 1,
    Mode.DAMPING: round(DAMPING_S / PERIOD_S) + 1,
}  # with the tick in which the time is noticed to be over


class Debts(NamedTuple):
    """Earlier events that still bind the robot."""

    hung_up: bool = False  # the holder of the lease did so since the last tick
    abandoned: bool = False  # the operator who moved it is gone: it has to stop, and to lose its torque
    uncleared: frozenset[FaultKind] = frozenset()  # faults that only an operator or a restart may end
    ousted: frozenset[Operator] = frozenset()  # operators, until they connect again


class TickEdge(NamedTuple):
    before: Memory
    debts: Debts  # with those of this tick
    after: Memory
    found: frozenset[FaultKind]  # faults detected in this tick
    torque: bool  # in any command
    gate_open: bool
    asked_idle: bool  # of every drive
    asked_closed: bool  # of any drive
    asked_unprepared: bool
    was_closed: bool  # whether every drive was, at some time since arming began

    @property
    def energises(self) -> bool:
        return self.after.mode in ENERGISED and self.before.mode not in ENERGISED

    @property
    def present(self) -> frozenset[FaultKind]:
        return self.found | {each.kind for each in self.after.faults}

    @property
    def reaction(self) -> Reaction:
        return max((kind.reaction for kind in self.present), default=Reaction.NONE)


class CallEdge(NamedTuple):
    before: Memory
    debts: Debts
    call: Call
    accepted: bool
    after: Memory


def tick_edge(robot: AbstractRobot, before: Memory, debts: Debts, after: Memory) -> TickEdge:
    """Return the edge of the tick that the robot has just run."""
    both = robot.drives.both
    return TickEdge(
        before=before,
        debts=debts,
        after=after,
        found=frozenset(fault.kind for fault in robot.monitor.found),
        torque=any(axis.torque_nm != 0.0 for axis in both),
        gate_open=robot.drives.abstract_gate.is_open,
        asked_idle=all(axis.asked_idle for axis in both),
        asked_closed=any(axis.asked_closed for axis in both),
        asked_unprepared=any(axis.asked_unprepared for axis in both),
        was_closed=all(axis.was_closed for axis in both),
    )


# debts


def at_tick(before: Memory, debts: Debts) -> Debts:
    """Return the debts that apply to the coming tick, in which a lease may expire."""
    lease = before.lease
    over = lease.holder is not None and (lease.lost or lease.remaining_s < PERIOD_S)
    return debts._replace(abandoned=debts.abandoned or debts.hung_up or (over and _moves_or_will(before)))


def after_tick(edge: TickEdge) -> Debts:
    before, uncleared = edge.before, edge.debts.uncleared
    if before.clearing:
        uncleared = frozenset(kind for kind in uncleared if kind in edge.found or kind.clears is Clears.BY_RESTART)
    lasting = (kind for kind in edge.found if kind.clears is not Clears.WHEN_GONE)
    uncleared = uncleared.union(kind for kind in lasting if kind.latches_idle or before.mode in ENERGISED)
    abandoned = edge.debts.abandoned and edge.after.mode in ENERGISED
    return Debts(abandoned=abandoned, uncleared=uncleared, ousted=edge.debts.ousted)


def after_call(edge: CallEdge) -> Debts:
    """A program may release its lease and hang up at once: its last request is then read after its end."""
    debts, call, holder = edge.debts, edge.call, edge.before.lease.holder
    if call.method == "hang_up":
        gone = holder is call.operator and _moves_or_will(edge.before)
        debts = debts._replace(hung_up=debts.hung_up or gone, ousted=debts.ousted - {call.operator})
    elif _is_own_release(edge):
        debts = debts._replace(hung_up=False)
    elif edge.accepted and call.takes_over and holder not in (None, call.operator):
        debts = debts._replace(ousted=debts.ousted | {holder})
    return debts


def _moves_or_will(memory: Memory) -> bool:
    return memory.mode in ENERGISED or memory.pending is Request.ARM


# promises


def _arms_by_request(edge: TickEdge) -> bool:
    asked = (edge.before.mode, edge.before.pending, edge.after.mode) == (Mode.IDLE, Request.ARM, Mode.ARMING)
    return not edge.energises or (asked and not edge.before.ending)


def _arms_only_unblocked(edge: TickEdge) -> bool:
    forced = edge.before.forced
    least = {kind: Blocks.ALWAYS if kind.value == forced else Blocks.UNLESS_FORCED for kind in edge.present}
    blocked = any(kind.blocks >= least[kind] for kind in edge.present) or edge.reaction >= Reaction.HOLD
    return not edge.energises or not (blocked or edge.debts.uncleared)


def _walks_by_request(edge: TickEdge) -> bool:
    if edge.after.mode is not Mode.WALKING or edge.before.mode is Mode.WALKING:
        return True
    asked = (edge.before.mode, edge.before.pending) == (Mode.HOLD, Request.WALK)
    return asked and not edge.before.ending and edge.reaction < Reaction.HOLD


def _moves_when_confirmed(edge: TickEdge) -> bool:
    begins = edge.after.mode in MOVING and edge.before.mode not in MOVING
    return not begins or (edge.before.mode is Mode.ARMING and edge.was_closed)


def _reacts(edge: TickEdge) -> bool:
    """The mode reacts by the hardest of all present faults, in the tick in which it is detected."""
    if edge.after.mode is Mode.ARMING:
        return edge.reaction < Reaction.SOFT_STOP
    return edge.after.mode not in ENERGISED or HARDNESS[edge.after.mode] >= MILDEST[edge.reaction]


def _disarms(edge: TickEdge) -> bool:
    ended = edge.before.mode in ENERGISED and edge.after.mode not in ENERGISED
    if edge.before.pending is Request.DISARM and edge.after.mode in ENERGISED:
        return False
    return not ended or (edge.asked_idle and not edge.after.obedient.closed)


def _stops(edge: TickEdge) -> bool:
    asked = (edge.before.mode, edge.before.pending) == (Mode.WALKING, Request.STOP)
    return not asked or edge.after.mode in (Mode.STOPPING, Mode.DAMPING, Mode.FAULT)


def _stays_stopped(edge: TickEdge) -> bool:
    return edge.before.mode is not Mode.STOPPING or edge.after.mode is not Mode.WALKING


def _ends_with_its_operator(edge: TickEdge) -> bool:
    return not edge.debts.abandoned or edge.after.mode not in (Mode.ARMING, Mode.HOLD, Mode.WALKING)


def _moves_in_hold(edge: TickEdge) -> bool:
    return not edge.after.moving or (edge.after.mode is Mode.HOLD and edge.reaction < Reaction.HOLD)


def _ends_fault_without_fault(edge: TickEdge) -> bool:
    left = edge.before.mode is Mode.FAULT and edge.after.mode is not Mode.FAULT
    return not left or (edge.after.mode is Mode.IDLE and edge.reaction < Reaction.SOFT_STOP)


TICK_PROMISES: dict[str, Callable[[TickEdge], bool]] = {
    "torque goes on only by a request to arm": _arms_by_request,
    "the robot arms with no fault that blocks arming or is not cleared": _arms_only_unblocked,
    "a walk begins only by a request, without a fault that holds": _walks_by_request,
    "a joint moves only when every drive has confirmed this arming": _moves_when_confirmed,
    "a drive is asked for closed loop only while arming": lambda edge: (
        not edge.asked_closed or edge.after.mode is Mode.ARMING
    ),
    "a drive is prepared before it is asked for closed loop": lambda edge: not edge.asked_unprepared,
    "torque is commanded only in modes that may": lambda edge: not edge.torque or edge.after.mode in MOVING,
    "the gate is open only while torque may be on": lambda edge: edge.gate_open == (edge.after.mode in ENERGISED),
    "every detected fault is present": lambda edge: edge.found <= {each.kind for each in edge.after.faults},
    "the hardest reaction counts at once": _reacts,
    "disarm, and every end of torque, asks all drives to go idle at once": _disarms,
    "a stop ends a walk at once": _stops,
    "a stop does not turn into a walk": _stays_stopped,
    "stopping and damping end in time": lambda edge: (
        edge.after.mode_ticks <= LONGEST_TICKS.get(edge.after.mode, edge.after.mode_ticks)
    ),
    "motion ends when its operator is lost": _ends_with_its_operator,
    "a move goes on only in hold and without a fault": _moves_in_hold,
    "a fault ends in idle, once no fault is present that stops": _ends_fault_without_fault,
    "force ends with the torque": lambda edge: not edge.after.forced or edge.after.mode in ENERGISED,
    "a request is answered once": lambda edge: edge.after.pending is Request.NONE,
}


def _is_permitted(edge: CallEdge) -> bool:
    """Return whether the call respects the lease: only the holder of a lease that is not lost moves the robot."""
    if not edge.accepted or edge.call.method not in ("arm", "walk", "move"):
        return True
    lease, caller = edge.before.lease, edge.call.operator
    in_time = not lease.lost and lease.remaining_s >= CALL_S - NOW_S
    free = lease.holder is None or (in_time and (lease.holder is caller or edge.call.takes_over))
    return free and caller not in edge.debts.ousted


def _is_pending(edge: CallEdge) -> bool:
    if edge.before.pending is Request.DISARM:
        return edge.after.pending is Request.DISARM
    if edge.call.method in ("stop", "disarm"):
        return edge.after.pending is Request[edge.call.method.upper()]
    return edge.accepted or edge.after.pending is edge.before.pending


def _is_own_release(edge: CallEdge) -> bool:
    return edge.call.method == "release" and edge.before.lease.holder is edge.call.operator


CALL_PROMISES: dict[str, Callable[[CallEdge], bool]] = {
    "stop and disarm are never refused": lambda edge: edge.accepted or edge.call.method not in ("stop", "disarm"),
    "only the holder of the lease moves the robot": _is_permitted,
    "disarm is not replaced, and no refused call replaces anything": _is_pending,
    "a stop ends a move": lambda edge: edge.call.method != "stop" or not edge.after.moving,
    "nothing arms or walks while the daemon ends": lambda edge: (
        not (edge.before.ending and edge.accepted and edge.call.method in ("arm", "walk"))
    ),
    "a lost lease stays lost while torque is on": lambda edge: (
        not (edge.before.lease.lost and edge.before.mode in ENERGISED) or edge.after.lease.lost or _is_own_release(edge)
    ),
}


def broken_by_tick(edge: TickEdge) -> list[str]:
    return [text for text, kept in TICK_PROMISES.items() if not kept(edge)]


def broken_by_call(edge: CallEdge) -> list[str]:
    return [text for text, kept in CALL_PROMISES.items() if not kept(edge)]


def is_home(memory: Memory) -> bool:
    """Return whether the robot could be armed now: no torque, no fault, nothing pending."""
    idle = not any(drive.closed or drive.reported_closed for drive in (memory.obedient, memory.other))
    return memory.mode is Mode.IDLE and idle and not memory.faults and memory.pending is Request.NONE


def is_quiet(memory: Memory) -> bool:
    """Return whether no torque is on."""
    return memory.mode not in ENERGISED and not memory.obedient.closed and not memory.other.closed
