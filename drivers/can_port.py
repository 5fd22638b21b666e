"""One CAN bus as the drives see it: frames in, frames out, losses counted.

python-can opens the interface (`socketcan` on the robot, `virtual` in tests, `mudskipper_local` between processes
without CAN) and carries the frames. Its Message objects stay on this side. Its `Bus.state` always says active on
socketcan, so the state comes from error frames. A bus that was off, or an interface that was gone, is active again
once a frame of a peer arrives: a controller that is off receives none. Frames are sent one by one, never by the
kernel's repetition (BCM), which would feed the drives' watchdogs with an old command after this process has died.
"""

from __future__ import annotations

import errno
import logging
import time
from collections.abc import Sequence
from typing import Protocol

import can

from drivers.error_frames import BusState as BusState  # for whoever looks at a port
from drivers.error_frames import decode_error_frame, next_state
from drivers.frames import Frame

# slcan: an unplugged adapter, a garbled line. socketcan asserts that a frame has a time stamp.
PORT_ERRORS = (can.CanError, OSError, ValueError, IndexError, AssertionError)
GONE = frozenset({errno.ENETDOWN, errno.ENODEV, errno.ENXIO})  # the interface is down, or unplugged
MOST_FAILURES_PER_READ = 32
MOST_FRAMES_PER_READ = 4096  # half a second of a full bus; a babbling node must not hold the loop for ever


class CanPort(Protocol):
    """What the drives need of a bus. `failed_sends` and `error_frames` only grow."""

    state: BusState
    failed_sends: int
    error_frames: int  # and reads that failed
    last_error: str  # of receiving
    last_send_error: str

    def receive(self) -> Sequence[Frame]:
        """All data frames that have arrived, oldest first; never waits."""

    def send(self, frame: Frame) -> None:
        """Does not wait for room; a frame that cannot be queued is dropped and counted, the next tick brings a newer
        one. (python-can's serial interfaces wait until the bytes have left.)
        """

    def close(self) -> None: ...


class PythonCanPort:
    """A CanPort over any python-can interface."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self.state = BusState.ACTIVE
        self.failed_sends = 0
        self.error_frames = 0
        self.last_error = ""
        self.last_send_error = ""
        self.state = BusState.ACTIVE

    def receive(self) -> list[Frame]:
        frames: list[Frame] = []
        failures = 0
        clock_s = time.monotonic() - time.time()  # python-can stamps with the clock on the wall
        for _ in range(MOST_FRAMES_PER_READ):
            try:
                message = self._bus.recv(0.0)
            except PORT_ERRORS as problem:  # garbage, with good frames behind it; or an interface that is down
                self.error_frames += 1
                self.last_error = str(problem)
                failures += 1
                if self._is_gone(problem) or failures == MOST_FAILURES_PER_READ:
                    break
                continue
            if message is None:
                break
            if message.is_error_frame:  # first: its class bits look like a drive's id
                self._heed_error_frame(message)
            else:
                frames.append(_as_frame(message, clock_s))
                if self.state is BusState.OFF and message.is_rx:  # not what a process beside us has sent
                    self.state = BusState.ACTIVE
        return frames

    def _heed_error_frame(self, message: can.Message) -> None:
        self.error_frames += 1
        class_bits = message.arbitration_id
        error = decode_error_frame(class_bits, bytes(message.data))
        self.last_error = error.text
        self.state = next_state(self.state, class_bits, error.state)

    def _is_gone(self, problem: Exception) -> bool:
        gone = isinstance(problem, OSError) and problem.errno in GONE
        if gone or (isinstance(problem, can.CanError) and problem.error_code in GONE):
            self.state = BusState.OFF
            return True
        return False

    def send(self, frame: Frame) -> None:
        message = can.Message(
            arbitration_id=frame.arbitration_id,
            data=frame.data,
            is_extended_id=frame.is_extended,
            is_remote_frame=frame.is_remote,
        )
        try:
            self._bus.send(message, 0.0)
        except PORT_ERRORS as problem:  # a full transmit queue (ENOBUFS) or an interface that is gone
            self.failed_sends += 1
            self.last_send_error = str(problem)
            self._is_gone(problem)

    def close(self) -> None:
        self._bus.shutdown()


def _as_frame(message: can.Message, clock_s: float) -> Frame:
    data, is_remote, is_extended = bytes(message.data), message.is_remote_frame, message.is_extended_id
    return Frame(message.arbitration_id, data, is_remote, False, is_extended, message.timestamp + clock_s)


def open_port(interface: str, channel: str, options: dict[str, str | int | float | bool]) -> PythonCanPort:
    """Raises what python-can raises where the interface does not open: see firmware_host/buses.py."""
    logging.getLogger("can").setLevel(logging.WARNING)  # at level debug it would format every frame it sends
    return PythonCanPort(can.Bus(interface=interface, channel=channel, **options))  # type: ignore[arg-type]
