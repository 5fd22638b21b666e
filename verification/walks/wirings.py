"""Makes the five kinds of buses between the simulated robot and the loop, each with its two ends.

SocketCAN is python-can's SocketcanBus on one end of a datagram pair, so no CAN is needed; a frame's path through the
kernel's CAN code and the driver is in no figure. The options of a CAN_RAW socket, such as filters, have no effect.
"""

import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import can
from can.interfaces.socketcan import SocketcanBus, constants, socketcan

from drivers.can.can_port import CanPort, PythonCanPort, open_port
from drivers.can.mock_bus import MockBus
from drivers.can.socketcan_port import SocketcanPort
from firmware_host.configuration.configuration import BusParameters


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
    """Gives this socket to the next bus that python-can opens."""
    with patch.object(socketcan, "create_socket", lambda: near), patch.object(socketcan, "bind_socket"):
        yield


def open_bus(near: socket.socket, fd: bool = False) -> SocketcanBus:
    with in_place_of_can(near):
        bus = can.Bus(interface="socketcan", channel="can0", fd=fd)
    assert isinstance(bus, SocketcanBus)
    return bus


class Wiring(NamedTuple):
    """The two ends of every bus, by its name."""

    robot: dict[str, CanPort]
    loop: dict[str, CanPort]


PortPair = tuple[CanPort, CanPort]  # the robot's end and the loop's


def python_can_pair(interface: str, channel: Path, fd: bool) -> PortPair:
    return open_port(interface, str(channel), {}, fd), open_port(interface, str(channel), {}, fd)


def mock_pair(channel: Path, fd: bool) -> PortPair:
    bus = MockBus()
    return bus.open(), bus.open()


def socketcan_pair(kind: type[PythonCanPort] | type[SocketcanPort], fd: bool) -> PortPair:
    far, near = open_pair()
    return SocketcanPort(open_bus(far, fd)), kind(open_bus(near, fd))


VARIANTS: dict[str, Callable[[Path, bool], PortPair]] = {
    "virtual": lambda channel, fd: python_can_pair("virtual", channel, fd),
    "mock": mock_pair,
    "local": lambda channel, fd: python_can_pair("mudskipper_local", channel, fd),
    "socketcan": lambda channel, fd: socketcan_pair(SocketcanPort, fd),
    "python-can": lambda channel, fd: socketcan_pair(PythonCanPort, fd),
}


def make_wiring(variant: str, buses: Mapping[str, BusParameters], folder: Path) -> Wiring:
    pairs = {name: VARIANTS[variant](folder / name, bus.data_bit_rate_kbit_s > 0) for name, bus in buses.items()}
    return Wiring(
        {name: robot for name, (robot, _) in pairs.items()}, {name: loop for name, (_, loop) in pairs.items()}
    )
