"""A CAN port whose interface may be missing for a while, such as an unplugged adapter.

A socket or a serial port whose device has vanished stays dead when the device is back. So this port opens its inner
port again, every RETRY_S while it is off. Opening reads files and may take a second, so it happens between two ticks
and only while the caller says that nothing moves. A port that was opened again counts as off until a frame has arrived
on it, or the report of another state, because its controller may still be off the bus.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress

from drivers.can.can_port import PORT_ERRORS, CanPort
from drivers.can.frames import Frame
from drivers.can.port_health import BusState

RETRY_S = 1.0


class NotOpenError(Exception):
    """The port does not open; the text says why."""


class ReopeningPort:
    """Implements CanPort. Owns its inner port, which is None while it does not open."""

    def __init__(self, open_port: Callable[[], CanPort], wait: bool) -> None:
        """`open_port` may raise NotOpenError; with `wait`, the port then starts as off instead of raising it."""
        self._open_port = open_port
        self._port: CanPort | None = None
        self._awaits_frame = False
        self._due_s: float | None = None  # when to try again
        self._failed_before = self._errors_before = self._lost_before = 0  # of the closed ports
        self._ids: Iterable[int] | None = None  # the ids that the drives listen to
        self.failed_sends = self.error_frames = self.lost_frames = 0
        self.last_error = self.last_send_error = ""
        try:
            self._port = open_port()
        except NotOpenError as problem:
            if not wait:
                raise
            self.last_error = str(problem)
        self._update_counters()

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
        self._update_counters()
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
            self._update_counters()

    def _update_counters(self) -> None:
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
        """Open the bus again where it has been off for RETRY_S; return whether it did."""
        if self.state is not BusState.OFF:
            self._due_s = None
            return False
        if self._due_s is not None and now_s >= self._due_s:
            self._due_s = now_s + RETRY_S
            return self._open_again()
        self._due_s = self._due_s or now_s + RETRY_S
        return False

    def _open_again(self) -> bool:
        self.close()
        try:
            self._port = self._open_port()
        except NotOpenError as problem:
            self.last_error = str(problem)
            return False
        if self._ids is not None:
            self._port.listen_to(self._ids)
        self._awaits_frame = True
        self._update_counters()
        return True

    def close(self) -> None:
        """Close the inner port, also where its device is gone, for which serial adapters raise errors."""
        port, self._port = self._port, None
        if port is not None:
            self._failed_before, self._errors_before = self.failed_sends, self.error_frames
            self._lost_before = self.lost_frames
            with suppress(*PORT_ERRORS):
                port.close()
