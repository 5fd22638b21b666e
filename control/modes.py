"""Modes of the robot, and the table of transitions between them.

`next_mode` is a pure function: it applies the first row of the present mode whose cause is true. A fault acts only by
its reaction (faults.py), so a new fault needs no new row. The documentation's diagram is drawn from this table.
Nothing arms by itself: torque needs the request `arm`.
"""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from control.faults import Fault, Reaction


class Mode(IntEnum):
    BOOT = 0  # not every drive has sent a message yet
    IDLE = 1  # drives without torque
    ARMING = 2  # drives asked into closed loop, with zero torque
    HOLD = 3  # the measured pose is held
    WALKING = 4
    STOPPING = 5  # flippers are raised out of the mud
    FAULT = 6  # drives without torque until the fault is over
    DAMPING = 7  # after a fault: joints are braked but not held


class Request(IntEnum):
    NONE = 0
    ARM = 1
    WALK = 2
    STOP = 3
    DISARM = 4
    CLEAR = 5


ENERGISED = frozenset({Mode.ARMING, Mode.HOLD, Mode.WALKING, Mode.STOPPING, Mode.DAMPING})
MOVING = ENERGISED - {Mode.ARMING}  # the modes that may command torque
HELD = MOVING - {Mode.DAMPING}  # the modes with stiffness
PREVENTED = "was prevented: "  # in the notice about a request that was accepted, which a fault of the next tick stopped


class Health(NamedTuple):
    """The state of the robot that transitions depend on."""

    drives_heard: bool = False
    closed_loop: bool = False  # all drives, since they were asked; only while arming
    walk_finished: bool = False  # all ordered strides are complete
    raised: bool = False  # the flippers are up, or the wait for them is over
    settled: bool = False  # damped joints are at rest, or the wait for that is over
    cut_short: bool = False  # the held pose is from the middle of a walk
    rested: bool = False  # the pose was held for the longest time without a request
    worst: Fault | None = None
    blocking: tuple[Fault, ...] = ()  # against arming

    @property
    def reaction(self) -> Reaction:
        return self.worst.kind.reaction if self.worst else Reaction.NONE


class Cause(NamedTuple):
    """The condition of a transition, with its text for the diagram."""

    text: str
    is_true: Callable[[Request, Health], bool]


class Transition(NamedTuple):
    sources: frozenset[Mode]
    cause: Cause
    target: Mode


def _at_least(reaction: Reaction) -> Cause:
    name = reaction.name.lower().replace("_", " ")
    return Cause(f"fault: {name}", lambda request, health: health.reaction >= reaction)


def _requested(wanted: Request) -> Cause:
    return Cause(wanted.name.lower(), lambda request, health: request is wanted)


def _is(text: str, is_true: Callable[[Health], bool]) -> Cause:
    return Cause(text, lambda request, health: is_true(health))


def _from(*modes: Mode) -> frozenset[Mode]:
    return frozenset(modes)


SOFT_STOP_DONE = Cause("raised, after a fault", lambda request, health: health.raised and _stopped(health))
STOP_AFTER_FAULT = Cause(
    "stop, after a fault has held a walk", lambda request, health: request is Request.STOP and health.cut_short
)
ARM_ACCEPTED = Cause("arm, and no fault blocks it", lambda request, health: request is Request.ARM and _well(health))
WALK_ACCEPTED = Cause("walk", lambda request, health: request is Request.WALK and health.reaction < Reaction.HOLD)


def _stopped(health: Health) -> bool:
    return health.reaction >= Reaction.SOFT_STOP


def _well(health: Health) -> bool:
    return health.drives_heard and not health.blocking and health.reaction < Reaction.HOLD


# In each mode the first row whose cause is true applies. A disarm precedes every row that continues with torque.
TRANSITIONS: tuple[Transition, ...] = (
    Transition(ENERGISED, _at_least(Reaction.DRIVES_IDLE), Mode.FAULT),
    Transition(ENERGISED, _requested(Request.DISARM), Mode.IDLE),
    Transition(_from(Mode.ARMING), _at_least(Reaction.SOFT_STOP), Mode.FAULT),
    Transition(HELD, _at_least(Reaction.DAMPING), Mode.DAMPING),
    Transition(_from(Mode.HOLD, Mode.WALKING), _at_least(Reaction.SOFT_STOP), Mode.STOPPING),
    Transition(_from(Mode.BOOT), _is("all drives heard", lambda health: health.drives_heard), Mode.IDLE),
    Transition(_from(Mode.IDLE), ARM_ACCEPTED, Mode.ARMING),
    Transition(_from(Mode.ARMING), _requested(Request.STOP), Mode.IDLE),
    Transition(_from(Mode.ARMING), _is("closed loop", lambda health: health.closed_loop), Mode.HOLD),
    Transition(_from(Mode.HOLD), WALK_ACCEPTED, Mode.WALKING),
    Transition(_from(Mode.HOLD), _is("held for too long", lambda health: health.rested), Mode.IDLE),
    Transition(_from(Mode.WALKING), _requested(Request.STOP), Mode.STOPPING),
    Transition(_from(Mode.HOLD), STOP_AFTER_FAULT, Mode.STOPPING),
    Transition(_from(Mode.WALKING), _is("strides done", lambda health: health.walk_finished), Mode.STOPPING),
    Transition(_from(Mode.WALKING), _at_least(Reaction.HOLD), Mode.HOLD),
    Transition(_from(Mode.STOPPING), SOFT_STOP_DONE, Mode.FAULT),
    Transition(_from(Mode.STOPPING), _is("raised", lambda health: health.raised), Mode.HOLD),
    Transition(_from(Mode.DAMPING), _is("at rest", lambda health: health.settled), Mode.FAULT),
    Transition(_from(Mode.FAULT), _is("fault is over", lambda health: not _stopped(health)), Mode.IDLE),
)

_ROWS_OF: dict[Mode, tuple[tuple[Callable[[Request, Health], bool], Mode], ...]] = {
    mode: tuple((row.cause.is_true, row.target) for row in TRANSITIONS if mode in row.sources) for mode in Mode
}


def next_mode(mode: Mode, request: Request, health: Health) -> Mode:
    """Return the mode of the next tick. A request that the mode does not accept changes nothing: see `refusal`."""
    for is_true, target in _ROWS_OF[mode]:
        if is_true(request, health):
            return target
    return mode


ACCEPTED_IN: dict[Request, frozenset[Mode]] = {
    Request.ARM: frozenset({Mode.IDLE}),
    Request.WALK: frozenset({Mode.HOLD}),
    Request.STOP: frozenset(Mode),
    Request.DISARM: frozenset(Mode),
    Request.CLEAR: frozenset({Mode.FAULT, Mode.IDLE}),
}


IN_MODE: dict[Mode, str] = {  # why a request is refused, and what to do
    Mode.BOOT: "not every drive was heard yet; see 'mudskipper check'",
    Mode.IDLE: "the drives are idle; 'mudskipper arm' first",
    Mode.ARMING: "the drives are being armed; try again in a moment",
    Mode.HOLD: "the robot already holds its pose; 'mudskipper walk' or 'mudskipper disarm' goes on",
    Mode.WALKING: "the robot walks; 'mudskipper stop' first",
    Mode.STOPPING: "the robot is stopping; try again in a moment",
    Mode.FAULT: "a fault is present; read 'mudskipper status', then 'mudskipper clear'",
    Mode.DAMPING: "a fault lets the joints sink; wait until they rest",
}


class Refusal(NamedTuple):
    """Why a request would change nothing in this mode."""

    mode: Mode
    request: Request
    faults: tuple[Fault, ...] = ()  # the faults that prevent it; without any, the mode does

    @property
    def text(self) -> str:
        """Return why the robot refuses the request, and what to do."""
        if self.faults:
            waits = ", 'arm --wait' waits for what ends by itself" if self.request is Request.ARM else ""
            return f"{' '.join(fault.message for fault in self.faults)} 'mudskipper check' says what to do{waits}."
        if self.request is Request.CLEAR and self.mode is Mode.HOLD:
            return "nothing to clear: the robot holds its pose; 'mudskipper walk' goes on"
        return IN_MODE[self.mode]


def refusal(mode: Mode, request: Request, health: Health) -> Refusal | None:
    """None if the request is accepted."""
    if mode not in ACCEPTED_IN.get(request, Mode):
        return Refusal(mode, request)
    prevented = {
        Request.ARM: not _well(health),
        Request.WALK: health.reaction >= Reaction.HOLD,
    }.get(request, False)
    if not prevented:
        return None
    blocking = health.blocking if request is Request.ARM else ()
    faults = blocking or ((health.worst,) if health.worst else ())
    return Refusal(mode if faults else Mode.BOOT, request, faults)
