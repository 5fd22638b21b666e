"""The CAN interfaces of the bench in place of the configured ones: `can0` for all buses, or `left=can0` for one.

Buses that share a channel are one bus: its drives then need different node ids.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from experiments.robot.bench_robot import BenchError
from firmware_host.configuration.configuration import BusParameters, Configuration

INTERFACE = "socketcan"


def on_channels(configuration: Configuration, given: Sequence[str]) -> Configuration:
    """Replace the channels of the buses. Raises BenchError."""
    channels = {name: channel for argument in given for name, channel in _named(configuration, argument).items()}
    first_on = {channel: name for name, channel in reversed(channels.items())}
    buses: dict[str, BusParameters] = {}
    for name, bus in configuration.bus.items():
        if name not in channels:
            buses[name] = bus
        elif first_on[channels[name]] == name:
            buses[name] = BusParameters(INTERFACE, channels[name], bit_rate_kbit_s=bus.bit_rate_kbit_s)
    drives = {
        joint: replace(drive, bus=first_on[channels[drive.bus]] if drive.bus in channels else drive.bus)
        for joint, drive in configuration.drive.items()
    }
    for (bus_name, node_id), count in Counter((drive.bus, drive.node_id) for drive in drives.values()).items():
        if count > 1:
            channel = buses[bus_name].channel
            raise BenchError(
                f"{count} drives have the node id {node_id} on {channel}: give each bus its own --can NAME=channel."
            )
    return replace(configuration, bus=buses, drive=drives)


def _named(configuration: Configuration, argument: str) -> dict[str, str]:
    name, equals, channel = argument.rpartition("=")
    if not channel:
        raise BenchError(f"--can {argument}: a channel is missing, as in --can left=can0.")
    if not equals:
        return dict.fromkeys(configuration.bus, channel)
    if name not in configuration.bus:
        raise BenchError(f"--can {argument}: no bus {name!r} is configured, only {', '.join(configuration.bus)}.")
    return {name: channel}
