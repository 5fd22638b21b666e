"""One CAN bus as the drives see it: frames in, frames out, losses counted.

python-can opens the interface (`socketcan` on the robot, `virtual` in tests, `mudskipper_local` between processes
without CAN) and carries the frames. Its Message objects stay on this side.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from enum import IntEnum
from typing import Protocol

import can

from drivers.frames import Frame

PORT_ERRORS = (can.CanError, OSError, ValueError, IndexError)  # slcan: an unplugged adapter, a garbled line
MOST_FAILURES_PER_READ = 32
MOST_FRAMES_PER_READ = 4096  # half a second of a full bus; a babbling node must not hold the loop for ever


class BusState(IntEnum):
    """Of a CAN controller by its error counters (ISO 11898-1), worst last."""

    ACTIVE = 0
    WARNING = 1
    PASSIVE = 2
    OFF = 3


class CanPort(Protocol):
    """What the drives need of a bus. `failed_sends` and `error_frames` only grow."""

    state: BusState
    failed_sends: int
    error_frames: int
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
        self.last_error = ""  # of receiving
        self.last_send_error = ""

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
                if failures == MOST_FAILURES_PER_READ:
                    break
                continue
            if message is None:
                break
            if message.is_error_frame:  # first: its class bits look like a drive's id
                self.error_frames += 1
            else:
                frames.append(_as_frame(message, clock_s))
        return frames

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

    def close(self) -> None:
        self._bus.shutdown()


def _as_frame(message: can.Message, clock_s: float) -> Frame:
    data, is_remote, is_extended = bytes(message.data), message.is_remote_frame, message.is_extended_id
    return Frame(message.arbitration_id, data, is_remote, False, is_extended, message.timestamp + clock_s)


def open_port(interface: str, channel: str, options: dict[str, str | int | float | bool]) -> PythonCanPort:
    """Raises what python-can raises where the interface does not open: see firmware_host/buses.py."""
    return PythonCanPort(can.Bus(interface=interface, channel=channel, **options))  # type: ignore[arg-type]
