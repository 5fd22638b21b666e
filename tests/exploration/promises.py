"""The promises of the robot for one tick and for one call, after any history.

A promise is a text and a condition on one edge of the graph that the search walks. Earlier events that still bind the
robot travel along as `Debts`, so that no promise relies on the code that it checks.
"""

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


def _kept_in_arming(edge: TickEdge) -> dict[str, bool]:
    """Return whether each promise about the way to torque is kept."""
    before, after, present = edge.before, edge.after, edge.present
    asked = (before.mode, before.pending, after.mode) == (Mode.IDLE, Request.ARM, Mode.ARMING) and not before.ending
    blocking = [
        kind
        for kind in present
        if kind.blocks >= (Blocks.ALWAYS if kind.value == before.forced else Blocks.UNLESS_FORCED)
    ]
    unblocked = not blocking and edge.reaction < Reaction.HOLD and not edge.debts.uncleared
    begins = after.mode in MOVING and before.mode not in MOVING
    return {
        "torque goes on only by a request to arm": not edge.energises or asked,
        "the robot arms with no fault that blocks arming or is not cleared": not edge.energises or unblocked,
        "a joint moves only when every drive has confirmed this arming": (
            not begins or before.mode is Mode.ARMING and edge.was_closed
        ),
        "a drive is asked for closed loop only while arming": not edge.asked_closed or after.mode is Mode.ARMING,
        "a drive is prepared before it is asked for closed loop": not edge.asked_unprepared,
        "torque is commanded only in modes that may": not edge.torque or after.mode in MOVING,
        "the gate is open only while torque may be on": edge.gate_open == (after.mode in ENERGISED),
        "force ends with the torque": not after.forced or after.mode in ENERGISED,
    }


def _kept_in_motion(edge: TickEdge) -> dict[str, bool]:
    """Return whether each promise about motion and its end is kept."""
    before, after, reaction = edge.before, edge.after, edge.reaction
    walks = after.mode is Mode.WALKING and before.mode is not Mode.WALKING
    asked = (before.mode, before.pending) == (Mode.HOLD, Request.WALK) and not before.ending
    stops = (before.mode, before.pending) == (Mode.WALKING, Request.STOP)
    disarms = before.pending is Request.DISARM and after.mode in ENERGISED
    ended = before.mode in ENERGISED and after.mode not in ENERGISED
    left_fault = before.mode is Mode.FAULT and after.mode is not Mode.FAULT
    if after.mode is Mode.ARMING:
        is_hard_enough = reaction < Reaction.SOFT_STOP
    else:
        is_hard_enough = after.mode not in ENERGISED or HARDNESS[after.mode] >= MILDEST[reaction]
    return {
        "a walk begins only by a request, without a fault that holds": not walks or asked and reaction < Reaction.HOLD,
        "every detected fault is present": edge.found <= {each.kind for each in after.faults},
        "the hardest reaction counts at once": is_hard_enough,
        "disarm, and every end of torque, asks all drives to go idle at once": (
            not disarms and (not ended or edge.asked_idle and not after.obedient.closed)
        ),
        "a stop ends a walk at once": not stops or after.mode in (Mode.STOPPING, Mode.DAMPING, Mode.FAULT),
        "a stop does not turn into a walk": before.mode is not Mode.STOPPING or after.mode is not Mode.WALKING,
        "stopping and damping end in time": after.mode_ticks <= LONGEST_TICKS.get(after.mode, after.mode_ticks),
        "motion ends when its operator is lost": (
            not edge.debts.abandoned or after.mode not in (Mode.ARMING, Mode.HOLD, Mode.WALKING)
        ),
        "a move goes on only in hold and without a fault": (
            not after.moving or after.mode is Mode.HOLD and reaction < Reaction.HOLD
        ),
        "a fault ends in idle, once no fault is present that stops": (
            not left_fault or after.mode is Mode.IDLE and reaction < Reaction.SOFT_STOP
        ),
        "a request is answered once": after.pending is Request.NONE,
    }


def _kept_by_call(edge: CallEdge) -> dict[str, bool]:
    before, after, method, caller = edge.before, edge.after, edge.call.method, edge.call.operator
    lease, moves = before.lease, edge.accepted and method in ("arm", "walk", "move")
    in_time = not lease.lost and lease.remaining_s >= CALL_S - NOW_S
    free = lease.holder is None or (in_time and (lease.holder is caller or edge.call.takes_over))
    if before.pending is Request.DISARM:
        replaced_well = after.pending is Request.DISARM
    elif method in ("stop", "disarm"):
        replaced_well = after.pending is Request[method.upper()]
    else:
        replaced_well = edge.accepted or after.pending is before.pending
    return {
        "stop and disarm are never refused": edge.accepted or method not in ("stop", "disarm"),
        "only the holder of the lease moves the robot": not moves or free and caller not in edge.debts.ousted,
        "disarm is not replaced, and no refused call replaces anything": replaced_well,
        "a stop ends a move": method != "stop" or not after.moving,
        "nothing arms or walks while the daemon ends": (
            not (before.ending and edge.accepted and method in ("arm", "walk"))
        ),
        "a lost lease stays lost while torque is on": (
            not (lease.lost and before.mode in ENERGISED) or after.lease.lost or _is_own_release(edge)
        ),
    }


def _is_own_release(edge: CallEdge) -> bool:
    return edge.call.method == "release" and edge.before.lease.holder is edge.call.operator


def broken_by_tick(edge: TickEdge) -> list[str]:
    kept = _kept_in_arming(edge) | _kept_in_motion(edge)
    return [text for text, is_kept in kept.items() if not is_kept]


def broken_by_call(edge: CallEdge) -> list[str]:
    return [text for text, is_kept in _kept_by_call(edge).items() if not is_kept]


def is_home(memory: Memory) -> bool:
    """Return whether the robot could be armed now: no torque, no fault, nothing pending."""
    idle = not any(drive.closed or drive.reported_closed for drive in (memory.obedient, memory.other))
    return memory.mode is Mode.IDLE and idle and not memory.faults and memory.pending is Request.NONE


def is_quiet(memory: Memory) -> bool:
    """Return whether no torque is on."""
    return memory.mode not in ENERGISED and not memory.obedient.closed and not memory.other.closed
