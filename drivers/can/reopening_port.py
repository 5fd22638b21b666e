"""A CAN port that may be gone for a while: an adapter that is unplugged, an interface that is not there yet.

A socket or a serial port whose device has vanished stays dead when the device is back, so the port behind this one is
opened anew, once in RETRY_S as long as it is off. Opening reads files and may take a second, so it is done between two
ticks and only where the caller says that nothing moves. A port that was opened anew counts as off until a frame has
arrived on it: its controller may still be out of the bus.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress

from drivers.can.can_port import PORT_ERRORS, BusState, CanPort
from drivers.can.frames import Frame

RETRY_S = 1.0


class NotOpenError(Exception):
    """A port does not open; the text says why."""


class ReopeningPort:
    """A CanPort. Owns the one behind it, of which there is none while it does not open."""

    def __init__(self, open_port: Callable[[], CanPort], wait: bool) -> None:
        """`open_port` raises NotOpenError; without `wait`, so does this."""
        self._open_port = open_port
        self._port: CanPort | None = None
        self._awaits_frame = False
        self._due_s: float | None = None  # the next try
        self._failed_before = self._errors_before = self._lost_before = 0  # of the ports before
        self._ids: Iterable[int] | None = None  # all that is listened to
        self.state = BusState.OFF
        self.failed_sends = self.error_frames = self.lost_frames = 0
        self.last_error = self.last_send_error = ""
        try:
            self._port = open_port()
        except NotOpenError as problem:
            if not wait:
                raise
            self.last_error = str(problem)
        self._look()

    def listen_to(self, ids: Iterable[int]) -> None:
        self._ids = frozenset(ids)
        if self._port is not None:
            self._port.listen_to(self._ids)

    def receive(self) -> Sequence[Frame]:
        if self._port is None:
            return ()
        frames = self._port.receive()
        if frames:
            self._awaits_frame = False
        self._look()
        return frames

    def send(self, frame: Frame) -> None:
        port = self._port
        if port is None:
            self._failed_before += 1
            self.failed_sends += 1
            self.last_send_error = self.last_error
            return
        port.send(frame)
        if self._failed_before + port.failed_sends != self.failed_sends:
            self._look()

    def _look(self) -> None:
        port = self._port
        if port is None:
            self.state = BusState.OFF
            return
        self.state = BusState.OFF if self._awaits_frame and port.state is BusState.ACTIVE else port.state
        self.failed_sends = self._failed_before + port.failed_sends
        self.error_frames = self._errors_before + port.error_frames
        self.lost_frames = self._lost_before + port.lost_frames
        self.last_error = port.last_error or self.last_error
        self.last_send_error = port.last_send_error or self.last_send_error

    def reopen(self, now_s: float) -> bool:
        """Where the bus has been off for RETRY_S, open it anew; whether that was done."""
        if self.state is not BusState.OFF:
            self._due_s = None
            return False
        if self._due_s is not None and now_s >= self._due_s:
            self._due_s = now_s + RETRY_S
            return self._open_anew()
        self._due_s = self._due_s or now_s + RETRY_S
        return False

    def _open_anew(self) -> bool:
        self.close()
        try:
            self._port = self._open_port()
        except NotOpenError as problem:
            self.last_error = str(problem)
            return False
        if self._ids is not None:
            self._port.listen_to(self._ids)
        self._awaits_frame = True
        self._look()
        return True

    def close(self) -> None:
        """Also where the device is gone, which serial adapters complain about."""
        port, self._port = self._port, None
        if port is not None:
            self._failed_before, self._errors_before = self.failed_sends, self.error_frames
            self._lost_before = self.lost_frames
            with suppress(*PORT_ERRORS):
                port.close()
