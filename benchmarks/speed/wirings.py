"""The five kinds of buses between the simulated robot and the loop, each with its two ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from benchmarks.speed.can_paths import Kind, open_bus, open_pair
from drivers.can.can_port import CanPort, PythonCanPort, open_port
from drivers.can.mock_bus import MockBus
from drivers.can.socketcan_port import SocketcanPort


class Wiring(NamedTuple):
    """The two ends of every bus, by its name."""

    robot: dict[str, CanPort]
    loop: dict[str, CanPort]


def python_can_wiring(interface: str, buses: Iterable[str], folder: Path) -> Wiring:
    robot: dict[str, CanPort] = {}
    loop: dict[str, CanPort] = {}
    for name in buses:
        robot[name] = open_port(interface, str(folder / name), {})
        loop[name] = open_port(interface, str(folder / name), {})
    return Wiring(robot, loop)


def virtual_wiring(buses: Iterable[str], folder: Path) -> Wiring:
    return python_can_wiring("virtual", buses, folder)


def mock_wiring(buses: Iterable[str], folder: Path) -> Wiring:
    mocks = {name: MockBus() for name in buses}
    robot = {name: mock.open() for name, mock in mocks.items()}
    return Wiring(dict(robot), {name: mock.open() for name, mock in mocks.items()})


def local_wiring(buses: Iterable[str], folder: Path) -> Wiring:
    return python_can_wiring("mudskipper_local", buses, folder)


def socketcan_wiring(kind: Kind, buses: Iterable[str]) -> Wiring:
    robot: dict[str, CanPort] = {}
    loop: dict[str, CanPort] = {}
    for name in buses:
        far, near = open_pair()
        robot[name], loop[name] = SocketcanPort(open_bus(far)), kind(open_bus(near))
    return Wiring(robot, loop)


VARIANTS: dict[str, Callable[[Iterable[str], Path], Wiring]] = {
    "virtual": virtual_wiring,
    "mock": mock_wiring,
    "local": local_wiring,
    "socketcan": lambda buses, folder: socketcan_wiring(SocketcanPort, buses),
    "socketcan by python-can": lambda buses, folder: socketcan_wiring(PythonCanPort, buses),
}
