"""What SocketCAN costs in a tick by python-can's own send and recv, and by the socket's own frames.

Both drive python-can's SocketcanBus, whose socket is one end of a datagram pair, so no CAN is needed; a frame's path
through the kernel's CAN code and the driver is in neither figure. A tick of one bus is one read of what two drives
send and two torques; ticks of the two paths alternate. Opening is python-can's: what it asks of CAN_RAW alone, such as
filters, the stand-in for its socket takes and ignores.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from time import perf_counter
from typing import Any
from unittest.mock import patch

import can
from can.interfaces.socketcan import SocketcanBus, constants, socketcan

from drivers.can.can_port import CanPort, PythonCanPort
from drivers.can.frames import FRAME_LAYOUT, Frame, decode_frame, encode_frame
from drivers.can.socketcan_port import SocketcanPort
from drivers.odrive import codec

BAR_RATIO = 2.0
TICKS = 3000
BUSES = 2
WARM_UP_TICKS = 500
CYCLIC = (codec.GET_ENCODER_ESTIMATES, codec.GET_IQ)  # every 2 ms, so in each tick and every third once more
REPORTED = [Frame(codec.arbitration_id(node, message), bytes(8)) for message in CYCLIC for node in (0, 1)]
COMMANDS = [Frame(codec.arbitration_id(node, codec.SET_INPUT_TORQUE), bytes(4)) for node in (0, 1)]
MORE_EVERY_TICKS = 3


class StandIn(socket.socket):
    """Accepts the options of a CAN_RAW socket and stores them."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.can_options: dict[int, Any] = {}

    def setsockopt(self, level: int, number: int, value: Any, *more: Any) -> None:
        if level == constants.SOL_CAN_RAW:
            self.can_options[number] = value
        else:
            super().setsockopt(level, number, value, *more)


def open_pair(kind: type[StandIn] = StandIn) -> tuple[StandIn, StandIn]:
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    a, b = (kind(end.family, end.type, end.proto, end.detach()) for end in ends)
    return a, b


@contextmanager
def in_place_of_can(near: socket.socket) -> Iterator[None]:
    """The next bus that python-can opens has this socket."""
    with patch.object(socketcan, "create_socket", lambda: near), patch.object(socketcan, "bind_socket"):
        yield


def open_bus(near: socket.socket) -> SocketcanBus:
    with in_place_of_can(near):
        bus = can.Bus(interface="socketcan", channel="can0")
    assert isinstance(bus, SocketcanBus)
    return bus


Kind = type[PythonCanPort] | type[SocketcanPort]


class Path:
    """One bus by one of both, and the far end of its socket."""

    def __init__(self, kind: Kind) -> None:
        self._far, near = open_pair()
        self._port: CanPort = kind(open_bus(near))

    def tick_s(self, reported: list[bytes]) -> float:
        for encoded in reported:
            self._far.send(encoded)
        start_s = perf_counter()
        frames = self._port.receive()
        for frame in COMMANDS:
            self._port.send(frame)
        duration_s = perf_counter() - start_s
        for frame in COMMANDS:
            sent = decode_frame(self._far.recv(FRAME_LAYOUT.size))
            if sent != frame or len(frames) != len(reported):
                raise RuntimeError(f"{sent} left and {len(frames)} frames of {len(reported)} arrived")
        return duration_s

    def close(self) -> None:
        self._port.close()
        self._far.close()


def compare_paths(ticks: int = TICKS) -> dict[str, Any]:
    """Medians of a tick's reads and sends on all buses, and their ratio."""
    paths = {"python_can": Path(PythonCanPort), "own": Path(SocketcanPort)}
    durations_s: dict[str, list[float]] = {name: [] for name in paths}
    encoded = [encode_frame(frame) for frame in REPORTED]
    for tick in range(-WARM_UP_TICKS, ticks):
        reported = encoded + encoded * (tick % MORE_EVERY_TICKS == 0)
        for name, path in paths.items():
            duration_s = path.tick_s(reported)
            if tick >= 0:
                durations_s[name].append(BUSES * duration_s)
    for path in paths.values():
        path.close()
    figures = {f"{name}_us": round(1e6 * median(found), 2) for name, found in durations_s.items()}
    ratio = median(durations_s["python_can"]) / median(durations_s["own"])
    return figures | {"ratio": round(ratio, 2), "bar_ratio": BAR_RATIO, "reached": ratio >= BAR_RATIO}
