"""The fast path on the robot: encoded frames on the socket that python-can has opened and configured.

python-can builds a Message for every frame, and calls `select` before each call; here a frame takes one `recvmsg` or
one `send` that does not wait. `recvmsg` is the only reading call that reports more than the bytes: the kernel's time
stamp (SO_TIMESTAMPNS, which python-can has enabled; it costs a tenth of the call and is accurate to some µs, where the
time of reading errs by up to a tick), how many frames found the queue full (SO_RXQ_OVFL), and whether another process
on this computer has sent the frame (MSG_DONTROUTE). Layouts: linux/can.h, linux/can/raw.h, socket(7). CAN FD frames
pass where the bus was opened with `fd = true`; elsewhere the kernel refuses to send them.

The kernel delivers the frames that the drives listen to, and all error frames, which filters do not affect. Other
frames on the bus are neither received nor counted: `candump` shows them.
"""

import socket
import struct
from collections.abc import Iterable

from can.interfaces.socketcan import SocketcanBus

from control.records import NEVER_S
from drivers.can.frames import (
    DATA_MAX_BYTES,
    ERROR_FLAG,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    FD_FRAME_LAYOUT,
    FRAME_LAYOUT,
    REMOTE_FLAG,
    STANDARD_MASK,
    Frame,
    decode_frame,
    encode_frame,
    without_stamps,
)
from drivers.can.port_health import MOST_FRAMES_PER_READ, BusState, PortHealth
from drivers.can.stamp_clock import StampClock

SO_TIMESTAMPNS, SO_RXQ_OVFL = 35, 40  # asm-generic/socket.h
STAMP, COUNT = struct.Struct("@ll"), struct.Struct("@I")  # in native layout: struct timespec, __u32
COUNT_RANGE = 1 << 32
ANCILLARY_BYTES = socket.CMSG_SPACE(STAMP.size) + socket.CMSG_SPACE(COUNT.size)
FRAME_BYTES, LENGTH_BYTE = FRAME_LAYOUT.size, 4
READ_BYTES = FD_FRAME_LAYOUT.size + 1  # so that a longer frame is noticed
FLAGS = EXTENDED_FLAG | REMOTE_FLAG | ERROR_FLAG
ALL_BITS = STANDARD_MASK | REMOTE_FLAG  # of a filter; with these the kernel uses a table lookup
ALL_EXTENDED_BITS = EXTENDED_MASK | REMOTE_FLAG


class SocketcanPort(PortHealth):
    """Sends and receives on the socket. Owns its mode, and the kernel's last count of lost frames."""

    def __init__(self, bus: SocketcanBus, clock: StampClock | None = None) -> None:
        super().__init__()
        self._clock = clock or StampClock()
        self._bus = bus
        self._socket = bus.socket
        self._socket.setblocking(False)
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
        read = self._socket.recvmsg
        clock_s = self._clock.offset_s()  # the kernel stamps with the wall clock
        for _ in range(MOST_FRAMES_PER_READ):
            try:
                encoded, ancillary, marks, _ = read(READ_BYTES, ANCILLARY_BYTES)
            except BlockingIOError:
                break
            except OSError as problem:  # the next read takes the rest
                self.on_failed_read(problem)
                break
            frame = self._on_frame(encoded, ancillary, clock_s)
            if frame is not None:
                frames.append(frame)
                if self.state is BusState.OFF:  # MSG_DONTROUTE marks frames of other processes on this computer
                    self.on_frame(not marks & socket.MSG_DONTROUTE)
        return frames if self._clock.offset_s() > NEVER_S else without_stamps(frames)

    def _on_frame(self, encoded: bytes, ancillary: list[tuple[int, int, bytes]], clock_s: float) -> Frame | None:
        """Return the frame, or None for an error frame and for bytes that are no frame.

        Frames are built by position, because this runs for each frame of a tick.
        """
        stamp_s = NEVER_S
        for _, kind, value in ancillary:
            if kind == SO_TIMESTAMPNS:
                seconds, nanoseconds = STAMP.unpack(value)
                stamp_s = seconds + 1e-9 * nanoseconds + clock_s
            elif kind == SO_RXQ_OVFL:  # lost frames since the socket's opening, modulo 2³²
                (count,) = COUNT.unpack(value)
                self.lost_frames += (count - self._kernel_count) % COUNT_RANGE
                self._kernel_count = count
        if len(encoded) != FRAME_BYTES or encoded[LENGTH_BYTE] > DATA_MAX_BYTES:
            return self._on_long_frame(encoded, stamp_s)
        word, length, payload = FRAME_LAYOUT.unpack(encoded)
        if not word & FLAGS:
            return Frame(word & STANDARD_MASK, payload[:length], False, False, False, stamp_s)
        if word & ERROR_FLAG:  # first: its class bits look like a drive's id
            self.on_error_frame(word & EXTENDED_MASK, payload[:length])
            return None
        is_remote, is_extended = word & REMOTE_FLAG != 0, word & EXTENDED_FLAG != 0
        identifier = word & (EXTENDED_MASK if is_extended else STANDARD_MASK)
        return Frame(identifier, b"" if is_remote else payload[:length], is_remote, False, is_extended, stamp_s)

    def _on_long_frame(self, encoded: bytes, stamp_s: float) -> Frame | None:
        """Return a CAN FD frame, or None for anything else, which counts as a failed read."""
        try:
            frame = decode_frame(encoded)
        except ValueError as problem:
            self.on_failed_read(problem)
            return None
        return frame._replace(stamp_s=stamp_s)

    def send(self, frame: Frame) -> None:
        try:
            self._socket.send(encode_frame(frame))
        except (OSError, ValueError) as problem:  # a full transmit queue (ENOBUFS) or an interface that is gone
            self.on_failed_send(problem)

    def close(self) -> None:
        self._bus.shutdown()
