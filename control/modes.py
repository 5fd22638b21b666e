"""Modes of the robot and the pure function that moves between them.

    BOOT ──heard──▶ IDLE ──arm──▶ ARMING ──closed loop──▶ HOLD ──walk──▶ WALKING ──stop──▶ STOPPING ──raised──▶ HOLD

A fault while torque is on leads to FAULT, which only `clear` leaves, to IDLE. `disarm` leads to IDLE wherever torque
is on, and idles the drives in every mode. Nothing arms by itself.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from control.faults import Fault


class Mode(IntEnum):
    BOOT = 0  # not every drive was heard yet
    IDLE = 1  # drives without torque
    ARMING = 2  # drives asked into closed loop, with zero torque
    HOLD = 3  # the measured pose is held
    WALKING = 4
    STOPPING = 5  # flippers are raised out of the mud
    FAULT = 6  # drives without torque until somebody clears the fault


class Request(IntEnum):
    NONE = 0
    ARM = 1
    WALK = 2
    STOP = 3
    DISARM = 4
    CLEAR = 5


ENERGISED = frozenset({Mode.ARMING, Mode.HOLD, Mode.WALKING, Mode.STOPPING})
MOVING = frozenset({Mode.HOLD, Mode.WALKING, Mode.STOPPING})  # the modes that may command torque


class Health(NamedTuple):
    """What the transitions depend on."""

    drives_heard: bool = False
    closed_loop: bool = False  # all four drives
    walk_finished: bool = False  # the strides asked for are done
    raised: bool = False  # the flippers are up, or the wait for them is over
    fault: Fault | None = None


def next_mode(mode: Mode, request: Request, health: Health) -> Mode:
    """The mode of the next tick. A request that does not fit the mode changes nothing: see `refusal`."""
    if mode in ENERGISED and health.fault is not None:
        return Mode.FAULT
    if request is Request.DISARM and mode in ENERGISED:
        return Mode.IDLE
    match mode:
        case Mode.BOOT:
            return Mode.IDLE if health.drives_heard else Mode.BOOT
        case Mode.IDLE:
            return _after_idle(request, health)
        case Mode.ARMING:
            return Mode.HOLD if health.closed_loop else Mode.ARMING
        case Mode.HOLD:
            return Mode.WALKING if request is Request.WALK else Mode.HOLD
        case Mode.WALKING:
            return Mode.STOPPING if request is Request.STOP or health.walk_finished else Mode.WALKING
        case Mode.STOPPING:
            return Mode.HOLD if health.raised else Mode.STOPPING
        case Mode.FAULT:
            return Mode.IDLE if request is Request.CLEAR and health.fault is None else Mode.FAULT


def _after_idle(request: Request, health: Health) -> Mode:
    well = health.drives_heard and health.fault is None
    return Mode.ARMING if request is Request.ARM and well else Mode.IDLE


ACCEPTED_IN: dict[Request, frozenset[Mode]] = {
    Request.ARM: frozenset({Mode.IDLE}),
    Request.WALK: frozenset({Mode.HOLD}),
    Request.STOP: frozenset(Mode),
    Request.DISARM: frozenset(Mode),
    Request.CLEAR: frozenset({Mode.FAULT, Mode.IDLE}),
}
WHAT_TO_DO: dict[Mode, str] = {
    Mode.BOOT: "not every drive was heard yet; see 'mudskipper check'",
    Mode.IDLE: "the drives are idle; 'mudskipper arm' first",
    Mode.ARMING: "the drives are being armed; try again in a moment",
    Mode.HOLD: "the robot already holds its pose",
    Mode.WALKING: "the robot walks; 'mudskipper stop' first",
    Mode.STOPPING: "the robot is stopping; try again in a moment",
    Mode.FAULT: "a fault is latched; read 'mudskipper status', then 'mudskipper clear'",
}


def refusal(mode: Mode, request: Request, health: Health) -> str | None:
    """Why a request would change nothing now, as a sentence; None where it is accepted."""
    if request is Request.ARM and mode is Mode.IDLE and health.fault is not None:
        return health.fault.sentence
    if request is Request.CLEAR and health.fault is not None:
        return f"the cause persists: {health.fault.sentence}"
    return None if mode in ACCEPTED_IN.get(request, Mode) else WHAT_TO_DO[mode]
