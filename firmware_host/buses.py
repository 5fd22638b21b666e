"""Opens the CAN buses that the configuration names, and takes the role that only one program may have on each."""

import errno
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from typing import TypeVar

import can

from drivers.can.bus_lock import BusLock, BusRole, BusTakenError
from drivers.can.can_port import CanPort, open_port
from drivers.can.reopening_port import NotOpenError, ReopeningPort
from firmware_host.configuration.configuration import BusParameters

Port = TypeVar("Port", bound=CanPort)
CAUSES = {
    errno.ENODEV: "there is no such interface; plug it in, or correct its channel in the configuration",
    errno.ENOENT: "there is no such device; plug it in, or correct its channel in the configuration",
    errno.EACCES: "this user may not use it; join the group that owns it, such as dialout",
    errno.EAFNOSUPPORT: "this kernel has no CAN; try 'modprobe can-raw'",
    errno.ENETDOWN: "the interface is down; bring it up as in docs/how-to/install.md",
}


class BusError(NotOpenError):
    """A bus does not open; the message names the bus and the cause."""


def open_bus(name: str, bus: BusParameters) -> CanPort:
    """Open one bus; raises BusError."""
    try:
        return open_port(bus.interface, bus.channel, bus.options, fd=bus.data_bit_rate_kbit_s > 0)
    except Exception as problem:  # python-can's drivers raise what they like, NameError too
        cause = CAUSES.get(_error_number(problem)) or " ".join(str(problem).split())
        if not isinstance(problem, can.CanError | OSError | ValueError | TypeError):
            cause = f"its driver cannot be used on this computer ({type(problem).__name__}: {cause}); install it"
        raise BusError(f"bus.{name} ({bus.interface} {bus.channel}) does not open: {cause}") from problem


def _error_number(problem: BaseException | None) -> int:
    """Return the operating system's error number that caused an exception of a CAN library, or 0."""
    while problem is not None:
        number = problem.errno if isinstance(problem, OSError) else getattr(problem, "error_code", None)
        if number:
            return int(number)
        problem = problem.__cause__ or problem.__context__
    return 0


def lock_buses(buses: Mapping[str, BusParameters], role: BusRole) -> ExitStack:
    """Take a role on every bus, before a frame is sent; raises BusError where another program has it."""
    names: dict[tuple[str, str], str] = {}  # two sections may share one channel
    for name, bus in buses.items():
        names.setdefault((bus.interface, bus.channel), name)
    with ExitStack() as locks:
        for (interface, channel), name in names.items():
            try:
                locks.callback(BusLock(role, interface, channel).close)
            except (BusTakenError, OSError) as problem:
                raise BusError(f"bus.{name} ({interface} {channel}) does not open: {problem}") from problem
        return locks.pop_all()


def open_ports(buses: Mapping[str, BusParameters]) -> dict[str, CanPort]:
    """Open every bus, by name; if one fails, close the others and raise BusError."""
    return _all_or_none(buses, open_bus)


def reopening_ports(buses: Mapping[str, BusParameters], wait: bool) -> dict[str, ReopeningPort]:
    """Open every bus as a port that can reopen after it was unplugged; with `wait` it may be missing at first."""
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
