"""The health that every kind of CAN port tracks: the bus's state, and the last errors.

SocketCAN's error frames report the state of the controller, with the layout of linux/can/error.h. The identifier
contains class bits; for CAN_ERR_CRTL byte 1 reports the state of the controller, and where CAN_ERR_CNT is set bytes 6
and 7 are its transmit and receive error counters. ISO 11898-1 gives the bounds of the states: warning from 96 errors,
passive from 128, bus-off above 255 transmit errors. A controller that is off neither sends nor receives until it is
restarted, so its other reports leave it off.

A bus that was off is active again once a frame of a peer arrives, because a controller that is off receives none. An
interface that was gone is back with any frame, including one from another process on this computer, which is all that a
virtual interface carries. The port that receives frames calls `on_frame` while it is off.
"""

import errno
from enum import IntEnum
from typing import NamedTuple

MOST_FRAMES_PER_READ = 4096  # half a second of a full bus; a babbling node must not block the loop
# The interface is down, or unplugged; EIO is how a serial adapter ends.
GONE = frozenset({errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EIO})


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
    if not class_bits & COUNTERS:
        return None
    errors = max(data[6], data[7])
    if errors >= PASSIVE_ERRORS:
        return BusState.PASSIVE
    return BusState.WARNING if errors >= WARNING_ERRORS else BusState.ACTIVE


def next_state(state: BusState, class_bits: int, reported: BusState | None) -> BusState:
    """Return the state after an error frame that reports a state. Only a restart leads out of bus-off."""
    if reported is None or (state is BusState.OFF and not class_bits & RESTARTED):
        return state
    return reported


class PortHealth:
    """Tracks the state of a port. Its counters only grow."""

    def __init__(self) -> None:
        self.state = BusState.ACTIVE
        self._gone = False  # it is off because the interface is gone
        self.failed_sends = 0
        self.error_frames = 0
        self.lost_frames = 0
        self.last_error = ""
        self.last_send_error = ""

    def on_error_frame(self, class_bits: int, data: bytes) -> None:
        self.error_frames += 1
        error = decode_error_frame(class_bits, data)
        self.last_error = error.text
        self.state = next_state(self.state, class_bits, error.state)

    def on_frame(self, from_peer: bool) -> None:
        """Handle a frame on a port that is off."""
        if from_peer or self._gone:
            self.state, self._gone = BusState.ACTIVE, False

    def on_failed_read(self, problem: Exception) -> bool:
        """Count the failure; return whether the interface is gone."""
        self.error_frames += 1
        self.last_error = _text_of(problem)
        return self._on_gone(problem)

    def on_failed_send(self, problem: Exception) -> None:
        self.failed_sends += 1
        self.last_send_error = _text_of(problem)
        self._on_gone(problem)

    def _on_gone(self, problem: Exception) -> bool:
        gone = _error_number(problem) in GONE
        if gone:
            self.state, self._gone = BusState.OFF, True
        return gone


def _error_number(problem: BaseException | None) -> int | None:
    """Return the errno, which python-can's own errors carry as `error_code` or in their cause."""
    if problem is None:
        return None
    number: int | None = getattr(problem, "errno", None) or getattr(problem, "error_code", None)
    return number or _error_number(problem.__cause__)


def _text_of(problem: Exception) -> str:
    if isinstance(problem.__cause__ or problem, BlockingIOError):
        return "Transmit buffer full"  # in python-can's words; a read that would block has not failed
    text = getattr(problem, "strerror", None) or str(problem)
    return f"{text}: {problem.__cause__}" if problem.__cause__ else text
