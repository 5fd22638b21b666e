"""Opens the buses for the commands on drives, which never share them with the daemon."""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from drivers.bench.bench_port import BenchPort
from drivers.bench.search import SearchResult, search
from drivers.can.bus_lock import BusRole
from drivers.can.can_port import CanPort
from drivers.drive_types import DRIVE_BENCHES
from firmware_host.buses import BusError, lock_buses, open_ports
from firmware_host.configuration.configuration import BusParameters

FD_RATE_KBIT_S = 5000
STOP_DAEMON = "If that is the daemon: 'systemctl stop mudskipper', with the robot disarmed."


class OpenedBus(NamedTuple):
    """One bus, and what the bench needs to know about it."""

    name: str
    parameters: BusParameters
    port: BenchPort
    can_port: CanPort  # the same bus, for a driver

    @property
    def carries_fd(self) -> bool:
        return self.parameters.data_bit_rate_kbit_s > 0

    def search(self, types: Collection[str], show: Callable[[str, int, int], None]) -> SearchResult:
        """Search for drives of these types, of all without one."""
        return search(self.port, DRIVE_BENCHES, self.carries_fd, types, show)


@contextmanager
def opened_buses(buses: dict[str, BusParameters]) -> Iterator[list[OpenedBus]]:
    """Yield the buses; no other program of this computer can command their drives meanwhile. Raises BusError."""
    try:
        locks = lock_buses(buses, BusRole.COMMANDS)
    except BusError as problem:
        raise BusError(f"{problem}. {STOP_DAEMON}") from problem
    with locks:
        ports = open_ports(buses)
        try:
            yield [OpenedBus(name, buses[name], make_bench_port(ports[name]), ports[name]) for name in buses]
        finally:
            for port in ports.values():
                port.close()


make_bench_port = BenchPort  # a test replaces it by one with a simulated clock
