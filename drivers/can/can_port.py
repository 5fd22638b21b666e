"""One CAN bus as the drives see it: it receives and sends frames, and counts the lost ones.

python-can opens the interface (`socketcan` on the robot, `slcan` for a serial adapter, `virtual` in tests,
`mudskipper_local` between processes without CAN) and carries the frames, except on socketcan: see socketcan_port.py.
Its `Bus.state` is always active on socketcan, so the state comes from error
frames. Each frame is sent once. The kernel's cyclic transmission (BCM) is never used, because it would feed the drives'
watchdogs with an old command after this process has died.
"""

import logging
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any, Protocol

import can
from can.interfaces.socketcan import SocketcanBus

from control.computing.suggestion import suggestion
from control.records import NEVER_S
from drivers.can.can_fd import fd_options
from drivers.can.frames import Frame, without_stamps
from drivers.can.port_health import MOST_FRAMES_PER_READ, BusState, PortHealth
from drivers.can.slcan_serial import SlcanSerial
from drivers.can.socketcan_port import SocketcanPort
from drivers.can.stamp_clock import StampClock

# slcan raises them for an unplugged adapter or a malformed line; socketcan asserts that a frame has a time stamp.
PORT_ERRORS = (can.CanError, OSError, ValueError, IndexError, AssertionError)
MOST_FAILURES_PER_READ = 32
ECHOING_INTERFACES = ("udp_multicast",)
ECHO = "it would receive its own frames, which look like another program's commands"


class CanPort(Protocol):
    """A bus as the drives use it. `failed_sends`, `error_frames` and `lost_frames` only grow."""

    state: BusState
    failed_sends: int
    error_frames: int  # and reads that failed
    lost_frames: int  # that arrived and found no room, where the kernel reports it
    last_error: str  # of receiving
    last_send_error: str

    def listen_to(self, ids: Iterable[int]) -> None:
        """Keep frames of other ids away, where the port can."""

    def receive(self) -> Sequence[Frame]:
        """Return all data frames that have arrived, oldest first; never waits."""

    def send(self, frame: Frame) -> None:
        """Queue a frame without waiting. Without room it is dropped and counted; the next tick sends a newer one."""

    def close(self) -> None: ...


class PythonCanPort(PortHealth):
    """Sends and receives through any python-can interface."""

    def __init__(self, bus: can.BusABC, clock: StampClock | None = None) -> None:
        super().__init__()
        self._bus = bus
        self._clock = clock or StampClock()

    def listen_to(self, ids: Iterable[int]) -> None:
        """Does nothing, because python-can would build a Message first and compare it then."""

    def receive(self) -> list[Frame]:
        frames: list[Frame] = []
        failures = 0
        clock_s = self._clock.offset_s()  # python-can stamps with the wall clock
        for _ in range(MOST_FRAMES_PER_READ):
            try:
                message = self._bus.recv(0.0)
                if message is None:
                    if self._drained():
                        break
                    continue
            except PORT_ERRORS as problem:  # garbage that good frames may follow, or an interface that is down
                failures += 1
                if self.on_failed_read(problem) or failures == MOST_FAILURES_PER_READ:
                    break
                continue
            if message.is_error_frame:  # first: its class bits look like a drive's id
                self.on_error_frame(message.arbitration_id, bytes(message.data))
            else:
                frames.append(frame_from(message, clock_s))
                if self.state is BusState.OFF:
                    self.on_frame(message.is_rx)
        return frames if self._clock.offset_s() > NEVER_S else without_stamps(frames)

    def _drained(self) -> bool:
        """Return whether a `recv` without a frame means that none has arrived."""
        return True

    def send(self, frame: Frame) -> None:
        message = message_from(frame)
        try:
            if frame.is_fd and self._bus.protocol is can.CanProtocol.CAN_20:
                raise ValueError("the interface was not opened for CAN FD")
            self._bus.send(message, 0.0)
        except PORT_ERRORS as problem:  # a full transmit queue (ENOBUFS) or an interface that is gone
            self.on_failed_send(problem)

    def close(self) -> None:
        with suppress(*PORT_ERRORS):  # the adapter may be unplugged already
            self._bus.shutdown()


class SlcanPort(PythonCanPort):
    """Uses a serial adapter that speaks the LAWICEL protocol, through python-can's slcan interface."""

    def __init__(self, bus: Any) -> None:  # slcanBus; its module complains where pyserial is missing
        super().__init__(bus)
        self._serial = bus.serialPortOrig = SlcanSerial(bus.serialPortOrig)
        self._refusals = 0

    def receive(self) -> list[Frame]:
        frames = super().receive()
        if self._serial.refusals != self._refusals:
            self.failed_sends += self._serial.refusals - self._refusals
            self._refusals = self._serial.refusals
            self.last_send_error = "the adapter refused a frame"
        return frames

    def _drained(self) -> bool:
        """The adapter answers every frame that is sent, and python-can returns None for an answer."""
        return self._serial.in_waiting == 0


def frame_from(message: can.Message, clock_s: float = 0.0) -> Frame:
    """Convert a message of python-can. `clock_s` is the monotonic clock minus the wall clock, which stamped it."""
    return Frame(
        arbitration_id=message.arbitration_id,
        data=bytes(message.data),
        is_remote=message.is_remote_frame,
        is_error=message.is_error_frame,
        is_extended=message.is_extended_id,
        stamp_s=message.timestamp + clock_s,
        is_fd=message.is_fd,
        bit_rate_switch=message.bitrate_switch,
    )


def message_from(frame: Frame) -> can.Message:
    return can.Message(
        arbitration_id=frame.arbitration_id,
        data=frame.data,
        is_remote_frame=frame.is_remote,
        is_error_frame=frame.is_error,
        is_extended_id=frame.is_extended,
        is_fd=frame.is_fd,
        bitrate_switch=frame.bit_rate_switch,
    )


def interface_problem(interface: str) -> str:
    """Return why an interface cannot be used; empty where it can."""
    if interface in ECHOING_INTERFACES:
        return ECHO
    if interface not in can.VALID_INTERFACES:
        return f"python-can has no such interface; {suggestion(interface, sorted(can.VALID_INTERFACES))}"
    return ""


def open_port(interface: str, channel: str, options: dict[str, str | int | float | bool], fd: bool = False) -> CanPort:
    """Open an interface; raises the exceptions of its python-can driver where it does not open: see buses.py.

    With `fd` it also carries CAN FD frames; ValueError is raised where it cannot.

    The configuration files and environment variables of python-can are ignored: they would add a user's own options to
    the bus, and reading them leaves garbage in cycles, which a process without a garbage collector never frees.
    """
    if problem := ECHO if options.get("receive_own_messages") else interface_problem(interface):
        raise ValueError(problem)
    logging.getLogger("can").setLevel(logging.CRITICAL)  # the exceptions say it too; debug would format every frame
    more: dict[str, Any] = (fd_options(interface, channel) if fd else {}) | options
    bus = can.Bus(interface=interface, channel=channel, ignore_config=True, **more)
    if isinstance(bus, SocketcanBus):
        return SocketcanPort(bus)
    return SlcanPort(bus) if interface == "slcan" else PythonCanPort(bus)
