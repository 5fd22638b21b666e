"""Decodes SocketCAN's error frames: the state of the controller, and a text that says what went wrong.

The layout is that of linux/can/error.h. The identifier contains class bits; for CAN_ERR_CRTL byte 1 reports the state
of the controller, and where CAN_ERR_CNT is set bytes 6 and 7 are its transmit and receive error counters. ISO 11898-1
gives the bounds of the states: warning from 96 errors, passive from 128, bus-off above 255 transmit errors. A
controller that is off neither sends nor receives until it is restarted, so its other reports leave it off.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class BusState(IntEnum):
    """The state of this computer's controller; a larger number is worse."""

    ACTIVE = 0
    WARNING = 1
    PASSIVE = 2
    OFF = 3


class BusError(NamedTuple):
    state: BusState | None  # None: the frame does not report it
    text: str


CONTROLLER, BUS_OFF, RESTARTED, COUNTERS = 0x004, 0x040, 0x100, 0x200
CLASS_NAMES = {
    0x001: "transmit time-out",
    0x002: "lost arbitration",
    0x008: "protocol violation",
    0x010: "transceiver fault",
    0x020: "no acknowledgement",
    BUS_OFF: "bus-off",
    0x080: "bus error",
    RESTARTED: "controller restarted",
}
CONTROLLER_NAMES = {
    0x01: "receive overflow",
    0x02: "transmit overflow",
    0x04: "receive warning",
    0x08: "transmit warning",
    0x10: "receive passive",
    0x20: "transmit passive",
    0x40: "active again",
}
STATE_BITS = {0x30: BusState.PASSIVE, 0x0C: BusState.WARNING, 0x40: BusState.ACTIVE}  # the worst first
PASSIVE_ERRORS, WARNING_ERRORS = 128, 96
DATA_BYTES = 8  # CAN_ERR_DLC; a shorter frame is read as if zeros followed


def decode_error_frame(class_bits: int, data: bytes) -> BusError:
    data = data.ljust(DATA_BYTES, b"\0")
    names = [name for bit, name in CLASS_NAMES.items() if class_bits & bit]
    if class_bits & CONTROLLER:
        names += [name for bit, name in CONTROLLER_NAMES.items() if data[1] & bit]
    if class_bits & COUNTERS:
        names.append(f"{data[6]} transmit and {data[7]} receive errors")
    return BusError(_reported_state(class_bits, data), ", ".join(names) or f"error class 0x{class_bits:x}")


def _reported_state(class_bits: int, data: bytes) -> BusState | None:
    if class_bits & BUS_OFF:
        return BusState.OFF
    if class_bits & CONTROLLER:
        for bits, state in STATE_BITS.items():
            if data[1] & bits:
                return state
    if class_bits & RESTARTED:
        return BusState.ACTIVE
    return _counted_state(max(data[6], data[7])) if class_bits & COUNTERS else None


def _counted_state(errors: int) -> BusState:
    if errors >= PASSIVE_ERRORS:
        return BusState.PASSIVE
    return BusState.WARNING if errors >= WARNING_ERRORS else BusState.ACTIVE


def next_state(state: BusState, class_bits: int, reported: BusState | None) -> BusState:
    """Returns the state after an error frame that reports a state. Only a restart leads out of bus-off."""
    if reported is None or (state is BusState.OFF and not class_bits & RESTARTED):
        return state
    return reported
