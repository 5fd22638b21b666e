"""Makes the buses between a simulated robot and the loop: our mock bus, or SocketCAN on pairs of sockets.

SocketCAN is python-can's SocketcanBus on one end of a datagram pair, so no CAN is needed; a frame's path through the
kernel's CAN code and the driver is in no figure. The options of a CAN_RAW socket, such as filters, have no effect.
"""

import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import can
from can.interfaces.socketcan import SocketcanBus, constants, socketcan

from drivers.can.can_port import CanPort
from drivers.can.mock_bus import MockBus
from drivers.can.socketcan_port import SocketcanPort


class CanSocket(socket.socket):
    """Stands in for a CAN_RAW socket: accepts its options and stores them."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.can_options: dict[int, Any] = {}

    def setsockopt(self, level: int, number: int, value: Any, *more: Any) -> None:
        if level == constants.SOL_CAN_RAW:
            self.can_options[number] = value
        else:
            super().setsockopt(level, number, value, *more)


def open_pair(kind: type[CanSocket] = CanSocket) -> tuple[CanSocket, CanSocket]:
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    a, b = (kind(end.family, end.type, end.proto, end.detach()) for end in ends)
    return a, b


@contextmanager
def in_place_of_can(near: socket.socket) -> Iterator[None]:
    """Give this socket to the next bus that python-can opens."""
    with patch.object(socketcan, "create_socket", lambda: near), patch.object(socketcan, "bind_socket"):
        yield


def open_bus(near: socket.socket, fd: bool = False) -> SocketcanBus:
    with in_place_of_can(near):
        bus = can.Bus(interface="socketcan", channel="can0", fd=fd)
    assert isinstance(bus, SocketcanBus)
    return bus


PortPair = tuple[CanPort, CanPort]  # the robot's end and the loop's


def _mock_pair(fd: bool) -> PortPair:
    bus = MockBus()
    return bus.open(), bus.open()


def _socketcan_pair(fd: bool) -> PortPair:
    far, near = open_pair()
    return SocketcanPort(open_bus(far, fd)), SocketcanPort(open_bus(near, fd))


BUSES: dict[str, Callable[[bool], PortPair]] = {"mock": _mock_pair, "socketcan": _socketcan_pair}


@contextmanager
def open_wiring(kind: str, buses: Iterable[str], fd: bool) -> Iterator[dict[str, PortPair]]:
    """Open the two ends of every bus, by its name, and close them at the end."""
    wiring = {name: BUSES[kind](fd) for name in buses}
    yield wiring
    for pair in wiring.values():
        for port in pair:
            port.close()
