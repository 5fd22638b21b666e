"""CAN interfaces as the kernel has them, and what is wrong with one.

`ip -details -json link show` tells all; its sample point is a string in older releases of iproute2 and a number in
newer ones, and a virtual interface (vcan) has neither state nor bit rate. Where iproute2 is missing, /sys/class/net
tells whether an interface is there, up, and how long its queue is.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import suppress
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

from drivers.can.bus_load import MOST_FRACTION, WARN_FRACTION, bus_load
from drivers.drive import DriveParameters
from drivers.drive_types import traffic_of
from firmware_host.computer.findings import Finding, fail, ok, warn
from firmware_host.configuration.configuration import BusParameters

QUEUE_FRAMES = (16, 64)  # fewer do not hold what arming sends in one tick, more deliver old torques late
LONGEST_RESTART_MS = 1000
SAMPLE_POINTS = (0.7, 0.9)
FLAG_UP = 0x1
ARPHRD_CAN = 280
NETWORK_FILE = "/etc/systemd/network/80-can.network"
GOOD_STATES = ("", "ERROR-ACTIVE")
BRING_UP = "'networkctl reload', or 'ip link set {0} up type can bitrate {1}000 restart-ms 100'"


class CanLink(NamedTuple):
    """One interface. Zero, nan or empty: not known."""

    name: str
    up: bool
    kind: str = ""  # can, vcan, slcan
    state: str = ""  # ERROR-ACTIVE, ERROR-WARNING, ERROR-PASSIVE, BUS-OFF, STOPPED
    bit_rate_bit_s: int = 0
    sample_point: float = nan
    restart_ms: int = -1
    queue_frames: int = 0


def parse_links(text: str) -> dict[str, CanLink]:
    """The CAN interfaces among those that `ip` printed. Nothing of what makes no sense."""
    try:
        links = json.loads(text)
    except ValueError:
        return {}
    if not isinstance(links, list):
        return {}
    wanted = [link for link in links if isinstance(link, dict) and link.get("link_type") == "can"]
    return {link.name: link for link in map(_parse_link, wanted)}


def _parse_link(link: dict[str, Any]) -> CanLink:
    reported, flags = _record(link, "linkinfo"), link.get("flags")
    details = _record(reported, "info_data")
    timing = _record(details, "bittiming")
    return CanLink(
        name=str(link.get("ifname", "")),
        up=isinstance(flags, list) and "UP" in flags,
        kind=str(reported.get("info_kind", "")),
        state=str(details.get("state", "")),
        bit_rate_bit_s=int(_number(timing.get("bitrate"), 0.0)),
        sample_point=_number(timing.get("sample_point"), nan),
        restart_ms=int(_number(details.get("restart_ms"), -1.0)),
        queue_frames=int(_number(link.get("txqlen"), 0.0)),
    )


def _record(within: dict[str, Any], key: str) -> dict[str, Any]:
    value = within.get(key)
    return value if isinstance(value, dict) else {}


def _number(value: object, otherwise: float) -> float:
    if isinstance(value, str | int | float):
        with suppress(ValueError):
            number = float(value)
            return number if isfinite(number) else otherwise
    return otherwise


def read_links(root: Path = Path("/")) -> dict[str, CanLink]:
    """Returns the links by name, from iproute2, or else from /sys."""
    with suppress(OSError, subprocess.SubprocessError):
        command = ["ip", "-details", "-json", "link", "show"]
        reported = subprocess.run(command, capture_output=True, text=True, timeout=5.0, check=True).stdout
        return parse_links(reported)
    return read_sys_links(root)


def read_sys_links(root: Path) -> dict[str, CanLink]:
    links = {}
    for folder in sorted((root / "sys/class/net").glob("*")):
        with suppress(OSError, ValueError):
            kind, flags, queue = ((folder / name).read_text() for name in ("type", "flags", "tx_queue_len"))
            if int(kind) == ARPHRD_CAN:
                up = bool(int(flags, 16) & FLAG_UP)
                links[folder.name] = CanLink(folder.name, up, queue_frames=int(queue))
    return links


def examine_bus(
    name: str, bus: BusParameters, drives: Sequence[DriveParameters], links: dict[str, CanLink]
) -> list[Finding]:
    """A bus of the configuration with `drives` on it, and the interface under it."""
    link = links.get(bus.channel)
    if bus.interface != "socketcan":
        return [ok(f"bus.{name}", f"{bus.interface} {bus.channel}"), examine_load(name, bus, drives, None)]
    if link is None:
        fix = f"plug it in, load its driver ('dmesg | grep -i can'), or correct bus.{name}.channel"
        missing = fail(f"bus.{name}", f"there is no interface {bus.channel}", fix)
        return [missing, examine_load(name, bus, drives, None)]
    return [_examine_state(name, bus, link), *_examine_settings(name, bus, link), examine_load(name, bus, drives, link)]


def _examine_state(name: str, bus: BusParameters, link: CanLink) -> Finding:
    identity, wires = f"bus.{name}", "check plugs, termination (120 ohm at both ends) and that all share one bit rate"
    if not link.up:
        return fail(identity, f"{link.name} is down", BRING_UP.format(link.name, bus.bit_rate_kbit_s))
    if link.state in GOOD_STATES:
        return ok(identity, f"{link.name} ({link.kind or 'CAN'}) is up{', error-active' if link.state else ''}")
    said = f"{link.name} is {link.state.lower()}"
    return warn(identity, said, wires) if link.state == "ERROR-WARNING" else fail(identity, said, wires)


def _examine_settings(name: str, bus: BusParameters, link: CanLink) -> Iterator[Finding]:
    wanted_bit_s = 1000 * bus.bit_rate_kbit_s
    if link.bit_rate_bit_s:
        identity, said = f"bit_rate.{name}", f"{link.name} runs at {link.bit_rate_bit_s / 1000:g} kbit/s"
        fix = f"set BitRate= in {NETWORK_FILE}, or bus.{name}.bit_rate_kbit_s if the drives run at that"
        said_wrong = f"{said}, its drives at {bus.bit_rate_kbit_s}"
        yield ok(identity, said) if link.bit_rate_bit_s == wanted_bit_s else fail(identity, said_wrong, fix)
    if isfinite(link.sample_point):
        identity, said = f"sample_point.{name}", f"{100.0 * link.sample_point:.1f} % of a bit"
        good = SAMPLE_POINTS[0] <= link.sample_point <= SAMPLE_POINTS[1]
        yield ok(identity, said) if good else warn(identity, said, f"set SamplePoint=80% in {NETWORK_FILE}")
    if link.restart_ms >= 0:
        identity, said = f"restart.{name}", f"back from bus-off after {link.restart_ms} ms"
        fix = f"set RestartSec=100ms in {NETWORK_FILE}"
        if link.restart_ms == 0:
            said = "after a bus-off the interface stays off"
        yield ok(identity, said) if 0 < link.restart_ms <= LONGEST_RESTART_MS else warn(identity, said, fix)
    if link.queue_frames:
        identity, said = f"queue.{name}", f"{link.queue_frames} frames may wait to be sent"
        good = QUEUE_FRAMES[0] <= link.queue_frames <= QUEUE_FRAMES[1]
        yield ok(identity, said) if good else warn(identity, said, f"'ip link set {link.name} txqueuelen 32'")


def examine_load(name: str, bus: BusParameters, drives: Sequence[DriveParameters], link: CanLink | None) -> Finding:
    """At the interface's bit rate where it is known, else at the one that the drives are said to have."""
    bit_s = (link.bit_rate_bit_s if link else 0) or 1000 * bus.bit_rate_kbit_s
    load = bus_load(traffic_of(drives), bit_s)
    identity, said = f"load.{name}", f"{len(drives)} drives will take {load} of {bit_s / 1000:g} kbit/s"
    fix = "raise the bit rate of interface and drives to 1 Mbit/s, or put two drives on a bus of their own"
    if load.most > MOST_FRACTION:
        return fail(identity, said, fix)
    return warn(identity, said, fix) if load.most > WARN_FRACTION else ok(identity, said)
