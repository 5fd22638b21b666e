"""The health that every kind of CAN port tracks: the bus's state, and the last errors.

A bus that was off is active again once a frame of a peer arrives, because a controller that is off receives none. An
interface that was gone is back with any frame, including one from another process on this computer, which is all that a
virtual interface carries. The port that receives frames calls `on_frame` while it is off.
"""

from __future__ import annotations

import errno

from drivers.can.error_frames import BusState, decode_error_frame, next_state

MOST_FRAMES_PER_READ = 4096  # half a second of a full bus; a babbling node must not block the loop
# The interface is down, or unplugged; EIO is how a serial adapter ends.
GONE = frozenset({errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EIO})


class PortHealth:
    """Counters only grow."""

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
        """Handles a frame on a port that is off."""
        if from_peer or self._gone:
            self.state, self._gone = BusState.ACTIVE, False

    def on_failed_read(self, problem: Exception) -> bool:
        """Counts the failure; returns whether the interface is gone."""
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
    """Returns the errno, which python-can's own errors carry as `error_code` or in their cause."""
    if problem is None:
        return None
    number: int | None = getattr(problem, "errno", None) or getattr(problem, "error_code", None)
    return number or _error_number(problem.__cause__)


def _text_of(problem: Exception) -> str:
    if isinstance(problem.__cause__ or problem, BlockingIOError):
        return "Transmit buffer full"  # in python-can's words; a read that would block has not failed
    text = getattr(problem, "strerror", None) or str(problem)
    return f"{text}: {problem.__cause__}" if problem.__cause__ else text
