"""The fast path on the robot: encoded frames on the socket that python-can has opened and configured.

python-can builds a Message for every frame, and calls `select` before each call; here one call reads all frames that
wait (socket_messages.py), and a frame takes one `send`, which does not wait. The kernel reports more than the bytes:
its time stamp (which python-can has enabled; it is accurate to some µs, where the time of reading errs by up to a
tick), how many frames found the queue full, and whether another process on this computer has sent the frame
(MSG_DONTROUTE). Layouts: linux/can.h, linux/can/raw.h, socket(7). CAN FD frames pass where the bus was opened with
`fd = true`; elsewhere the kernel refuses to send them.

The kernel delivers the frames that the drives listen to, and all error frames, which filters do not affect. Other
frames on the bus are neither received nor counted: `candump` shows them.
"""

import socket
from collections.abc import Iterable

from can.interfaces.socketcan import SocketcanBus

from control.records import NEVER_S
from drivers.can.frames import (
    DATA_MAX_BYTES,
    ERROR_FLAG,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    FRAME_LAYOUT,
    REMOTE_FLAG,
    STANDARD_MASK,
    Frame,
    decode_frame,
    encode_frame,
    without_stamps,
)
from drivers.can.port_health import MOST_FRAMES_PER_READ, BusState, PortHealth
from drivers.can.socket_messages import MOST, STAMPED_BYTES, SocketMessages
from drivers.can.stamp_clock import StampClock

SO_RXQ_OVFL = 40  # asm-generic/socket.h
COUNT_RANGE = 1 << 32
FRAME_BYTES = FRAME_LAYOUT.size
FLAGS = EXTENDED_FLAG | REMOTE_FLAG | ERROR_FLAG
ALL_BITS = STANDARD_MASK | REMOTE_FLAG  # of a filter; with these the kernel uses a table lookup
ALL_EXTENDED_BITS = EXTENDED_MASK | REMOTE_FLAG


class SocketcanPort(PortHealth):
    """Sends and receives on the socket. Owns its mode, and the kernel's last count of lost frames."""

    def __init__(
        self, bus: SocketcanBus, clock: StampClock | None = None, messages: SocketMessages | None = None
    ) -> None:
        super().__init__()
        self._clock = clock or StampClock()
        self._bus = bus
        self._socket = bus.socket
        self._socket.setblocking(False)
        self._messages = messages or SocketMessages(self._socket)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
        self._kernel_count = 0

    def listen_to(self, ids: Iterable[int]) -> None:
        """Set the kernel's filters. If the kernel refuses them, python-can logs it, and all frames are received."""
        extended = {each: each > STANDARD_MASK for each in ids}
        self._bus.set_filters(
            [
                {"can_id": each, "can_mask": ALL_EXTENDED_BITS if long else ALL_BITS, "extended": long}
                for each, long in extended.items()
            ]
        )

    def receive(self) -> list[Frame]:
        frames: list[Frame] = []
        clock_s = self._clock.offset_s()  # the kernel stamps with the wall clock
        for _ in range(MOST_FRAMES_PER_READ // MOST):
            try:
                arrived = self._messages.read()
            except OSError as problem:  # the next read takes the rest
                self.on_failed_read(problem)
                break
            for index, ((added, marks, size), (word, length, payload, seconds, nanoseconds)) in enumerate(arrived):
                stamp_s = seconds + 1e-9 * nanoseconds + clock_s
                frame: Frame | None
                if size == FRAME_BYTES and added == STAMPED_BYTES and length <= DATA_MAX_BYTES and not word & FLAGS:
                    frame = Frame(word & STANDARD_MASK, payload[:length], False, False, False, stamp_s)
                else:
                    frame = self._decoded(index, size, added, stamp_s)
                if frame is not None:
                    frames.append(frame)
                    if self.state is BusState.OFF:  # MSG_DONTROUTE marks frames of other processes on this computer
                        self.on_frame(not marks & socket.MSG_DONTROUTE)
            if len(arrived) < MOST:
                break
        return frames if self._clock.offset_s() > NEVER_S else without_stamps(frames)

    def _decoded(self, index: int, size: int, added: int, stamp_s: float) -> Frame | None:
        """Return any frame of the last read; None for an error frame, and for bytes that are no frame."""
        if added not in (0, STAMPED_BYTES):
            self._count_lost(self._messages.lost(index, added))
        if added < STAMPED_BYTES:
            stamp_s = NEVER_S
        try:
            frame = decode_frame(self._messages.data(index, size))
        except ValueError as problem:
            self.on_failed_read(problem)
            return None
        if frame.is_error:
            self.on_error_frame(frame.arbitration_id, frame.data)
            return None
        return frame._replace(stamp_s=stamp_s)

    def _count_lost(self, kernel_count: int) -> None:
        """Count the frames that were lost since the last count, which is one since the socket's opening."""
        self.lost_frames += (kernel_count - self._kernel_count) % COUNT_RANGE
        self._kernel_count = kernel_count

    def send(self, frame: Frame) -> None:
        try:
            self._socket.send(encode_frame(frame))
        except (OSError, ValueError) as problem:  # a full transmit queue (ENOBUFS) or an interface that is gone
            self.on_failed_send(problem)

    def close(self) -> None:
        self._bus.shutdown()
