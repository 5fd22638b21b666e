"""Opens the CAN buses that the configuration names."""

from __future__ import annotations

from collections.abc import Mapping

import can

from drivers.can_port import CanPort, open_port
from firmware_host.configuration import BusParameters


class BusError(Exception):
    """A bus does not open; the text names it and says why."""


def open_ports(buses: Mapping[str, BusParameters]) -> dict[str, CanPort]:
    """All of them, by name, or BusError and none."""
    ports: dict[str, CanPort] = {}
    for name, bus in buses.items():
        try:
            ports[name] = open_port(bus.interface, bus.channel, bus.options)
        except (can.CanError, OSError, ValueError, TypeError, ImportError) as problem:
            for port in ports.values():
                port.close()
            raise BusError(f"bus.{name} ({bus.interface} {bus.channel}) does not open: {problem}") from problem
    return ports
