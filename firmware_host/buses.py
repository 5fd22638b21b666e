"""Opens the CAN buses that the configuration names."""

from __future__ import annotations

import errno
from collections.abc import Callable, Mapping
from functools import partial
from typing import TypeVar

import can

from drivers.can.can_port import CanPort, open_port
from drivers.can.reopening_port import NotOpenError, ReopeningPort
from firmware_host.configuration.configuration import BusParameters

Port = TypeVar("Port", bound=CanPort)
WORDS = {
    errno.ENODEV: "there is no such interface; plug it in, or correct its channel in the configuration",
    errno.ENOENT: "there is no such device; plug it in, or correct its channel in the configuration",
    errno.EACCES: "this user may not use it; join the group that owns it, such as dialout",
    errno.EAFNOSUPPORT: "this kernel has no CAN; try 'modprobe can-raw'",
    errno.ENETDOWN: "the interface is down; bring it up as in docs/how-to/install.md",
}


class BusError(NotOpenError):
    """A bus does not open; the text names it and says why."""


def open_bus(name: str, bus: BusParameters) -> CanPort:
    """Raises BusError."""
    try:
        return open_port(bus.interface, bus.channel, bus.options)
    except (can.CanError, OSError, ValueError, TypeError, ImportError) as problem:
        why = WORDS.get(_error_number(problem), str(problem))
        raise BusError(f"bus.{name} ({bus.interface} {bus.channel}) does not open: {why}") from problem


def _error_number(problem: BaseException | None) -> int:
    """Of the operating system, where it is at the root of it."""
    while problem is not None:
        number = problem.errno if isinstance(problem, OSError) else getattr(problem, "error_code", None)
        if number:
            return int(number)
        problem = problem.__cause__ or problem.__context__
    return 0


def open_ports(buses: Mapping[str, BusParameters]) -> dict[str, CanPort]:
    """All of them, by name, or BusError and none."""
    return _all_or_none(buses, open_bus)


def reopening_ports(buses: Mapping[str, BusParameters], wait: bool) -> dict[str, ReopeningPort]:
    """The same, but of those that are opened again where they vanish. With `wait` they may be missing at first."""
    return _all_or_none(buses, lambda name, bus: ReopeningPort(partial(open_bus, name, bus), wait))


def _all_or_none(buses: Mapping[str, BusParameters], open_one: Callable[[str, BusParameters], Port]) -> dict[str, Port]:
    ports: dict[str, Port] = {}
    try:
        for name, bus in buses.items():
            ports[name] = open_one(name, bus)
    except BusError:
        for port in ports.values():
            port.close()
        raise
    return ports
