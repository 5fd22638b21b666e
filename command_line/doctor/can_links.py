"""Reads the settings of the kernel's CAN interfaces, and compares them with the configured buses.

`ip -details -json link show` prints the settings. Its sample point is a string in older releases of iproute2 and a
number in newer ones, and a virtual interface (vcan) has neither state nor bit rate. Where iproute2 is missing,
/sys/class/net shows whether an interface exists and is up, and how long its queue is.
"""

import json
import re
import subprocess
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

from command_line.doctor.findings import Finding, Level, fail, ok, ok_if, warn
from drivers.can.bus_load import MOST_FRACTION, WARN_FRACTION, bus_load
from drivers.can.can_fd import FD_MTU, carries_fd
from drivers.drive import DriveParameters
from drivers.drive_types import traffic_of
from firmware_host.configuration.configuration import BusParameters, Configuration
from firmware_host.configuration.service_file import UNIT

QUEUE_FRAMES = (16, 64)  # a shorter queue overflows in the tick of arming, a longer one delivers old torques late
LONGEST_RESTART_MS = 1000
SAMPLE_POINTS, FD_SAMPLE_POINTS = (0.7, 0.9), (0.6, 0.9)
FLAG_UP = 0x1
ARPHRD_CAN = 280
NETWORK_FILE = "/etc/systemd/network/80-can.network"
GOOD_STATES = ("", "ERROR-ACTIVE")
BRING_UP = "'networkctl reload', or 'ip link set {0} up type can bitrate {1}000 restart-ms 100'"
BRING_UP_FD = "'ip link set {0} up type can bitrate {1}000 dbitrate {2}000 fd on restart-ms 100'"


class CanLink(NamedTuple):
    """The settings of one interface. A setting that is not known is 0, NaN, empty, or -1 for the restart."""

    name: str
    up: bool
    kind: str = ""  # can, vcan, slcan
    state: str = ""  # ERROR-ACTIVE, ERROR-WARNING, ERROR-PASSIVE, BUS-OFF, STOPPED
    bit_rate_bit_s: int = 0
    sample_point: float = nan
    restart_ms: int = -1
    queue_frames: int = 0
    carries_fd: bool | None = None  # None: unknown
    data_bit_rate_bit_s: int = 0


def parse_links(text: str) -> dict[str, CanLink]:
    """Return the CAN interfaces in the output of `ip`. Raises ValueError for another output."""
    try:
        wanted = [link for link in json.loads(text) if link.get("link_type") == "can"]
        return {link.name: link for link in map(_parse_link, wanted)}
    except (AttributeError, KeyError, TypeError, OverflowError) as problem:
        raise ValueError("not the output of 'ip -json link show'") from problem


def _parse_link(link: dict[str, Any]) -> CanLink:
    info = link.get("linkinfo", {})
    details = info.get("info_data", {})
    timing = details.get("bittiming", {})
    return CanLink(
        name=link["ifname"],
        up="UP" in link["flags"],
        kind=info.get("info_kind", ""),
        state=details.get("state", ""),
        bit_rate_bit_s=int(timing.get("bitrate", 0)),
        sample_point=float(timing.get("sample_point", nan)),
        restart_ms=int(details.get("restart_ms", -1)),
        queue_frames=int(link.get("txqlen", 0)),
        carries_fd=link["mtu"] >= FD_MTU if "mtu" in link else None,
        data_bit_rate_bit_s=int(details.get("data_bittiming", {}).get("bitrate", 0)),
    )


def read_links(root: Path = Path("/")) -> dict[str, CanLink]:
    """Return the links by name, from iproute2, or else from /sys."""
    with suppress(OSError, subprocess.SubprocessError, ValueError):
        command = ["ip", "-details", "-json", "link", "show"]
        return parse_links(subprocess.run(command, capture_output=True, text=True, timeout=5.0, check=True).stdout)
    return read_sys_links(root)


def read_sys_links(root: Path) -> dict[str, CanLink]:
    links = {}
    for folder in sorted((root / "sys/class/net").glob("*")):
        with suppress(OSError, ValueError):
            kind, flags, queue = ((folder / name).read_text() for name in ("type", "flags", "tx_queue_len"))
            if int(kind) == ARPHRD_CAN:
                up = bool(int(flags, 16) & FLAG_UP)
                links[folder.name] = CanLink(folder.name, up, queue_frames=int(queue), carries_fd=carries_fd(folder))
    return links


def examine_buses(configuration: Configuration, links: dict[str, CanLink]) -> Iterator[Finding]:
    for name, bus in configuration.bus.items():
        drives = [drive for drive in configuration.drive.values() if drive.bus == name]
        yield from examine_bus(name, bus, drives, links)


def examine_unit(unit: str, present: Collection[str], configuration: Configuration) -> Iterator[Finding]:
    """Compare the interfaces that the service, by the text of its unit, waits for with those that its buses need."""
    waits, buses = not configuration.loop.wait_for_bus, configuration.bus.values()
    needed = {bus.channel for bus in buses if waits and bus.interface == "socketcan"}
    text = " ".join(re.findall(r"^BindsTo=(.*)$", unit, re.MULTILINE)).replace(r"\x2d", "-")
    bound = set(re.findall(r"sys-subsystem-net-devices-(\S+)\.device", text))
    own = "in a unit of your own edit BindsTo=, After= and WantedBy=, then 'systemctl reenable mudskipper'"
    fix = f"'mudskipper install' again writes /{UNIT} for your buses; {own}"
    for name in sorted(bound - needed - set(present)):
        yield fail("unit", f"the service does not start without {name}, which no bus needs", fix)
    for name in sorted(needed - bound) if unit else ():
        yield warn("unit", f"the service does not wait for {name}: at a boot it may give up before that is there", fix)


def examine_bus(
    name: str, bus: BusParameters, drives: Sequence[DriveParameters], links: dict[str, CanLink]
) -> list[Finding]:
    """Check a configured bus that has these drives, and its interface."""
    link = links.get(bus.channel)
    if bus.interface != "socketcan":
        state = [ok(f"bus.{name}", f"{bus.interface} {bus.channel}")]
    elif link:
        state = [_examine_state(name, bus, link), *_examine_settings(name, bus, link)]
    else:
        fix = f"plug it in, load its driver ('dmesg | grep -i can'), or correct bus.{name}.channel"
        state = [fail(f"bus.{name}", f"there is no interface {bus.channel}", fix)]
    return [*state, _examine_load(name, bus, drives, link if bus.interface == "socketcan" else None)]


def _examine_state(name: str, bus: BusParameters, link: CanLink) -> Finding:
    identity, wires = f"bus.{name}", "check plugs, termination (120 ohm at both ends) and that all share one bit rate"
    if not link.up:
        command = BRING_UP_FD if bus.data_bit_rate_kbit_s else BRING_UP
        fix = command.format(link.name, bus.bit_rate_kbit_s, bus.data_bit_rate_kbit_s)
        return fail(identity, f"{link.name} is down", fix)
    if link.state in GOOD_STATES:
        return ok(identity, f"{link.name} ({link.kind or 'CAN'}) is up{', error-active' if link.state else ''}")
    level = Level.WARN if link.state == "ERROR-WARNING" else Level.FAIL
    return Finding(identity, level, f"{link.name} is {link.state.lower()}", wires)


def _examine_settings(name: str, bus: BusParameters, link: CanLink) -> Iterator[Finding]:
    yield from _examine_rates(name, bus, link)
    if isfinite(link.sample_point):
        lowest, highest = FD_SAMPLE_POINTS if bus.data_bit_rate_kbit_s else SAMPLE_POINTS
        point = "66.6%" if bus.data_bit_rate_kbit_s else "80%"
        text, fix = f"{100.0 * link.sample_point:.1f} % of a bit", f"set SamplePoint={point} in {NETWORK_FILE}"
        yield ok_if(lowest <= link.sample_point <= highest, f"sample_point.{name}", text, fix)
    if link.restart_ms >= 0:
        after = f"back from bus-off after {link.restart_ms} ms"
        text = after if link.restart_ms else "after a bus-off the interface stays off"
        fix = f"set RestartSec=100ms in {NETWORK_FILE}"
        yield ok_if(0 < link.restart_ms <= LONGEST_RESTART_MS, f"restart.{name}", text, fix)
    if link.queue_frames:
        text, fix = f"{link.queue_frames} frames may wait to be sent", f"'ip link set {link.name} txqueuelen 32'"
        yield ok_if(QUEUE_FRAMES[0] <= link.queue_frames <= QUEUE_FRAMES[1], f"queue.{name}", text, fix)


def _examine_rates(name: str, bus: BusParameters, link: CanLink) -> Iterator[Finding]:
    """Compare the bit rates of the interface with those of the drives, as far as they are known."""
    wanted_kbit_s, data_kbit_s = bus.bit_rate_kbit_s, bus.data_bit_rate_kbit_s
    bring_up = BRING_UP_FD.format(link.name, wanted_kbit_s, data_kbit_s)
    fix = f"set BitRate= in {NETWORK_FILE}, or bus.{name}.bit_rate_kbit_s if the drives run at that"
    fix_fd = f"set FDMode=yes and DataBitRate={data_kbit_s}K in {NETWORK_FILE}, or {bring_up}"
    if data_kbit_s and link.carries_fd is not None:
        text = f"{link.name} {'carries' if link.carries_fd else 'does not carry'} CAN FD frames"
        yield ok_if(link.carries_fd, f"fd.{name}", text, fix_fd, Level.FAIL)
    rate, data_rate = f"{link.name} runs at", f"{link.name} sends data at"
    yield from _compare_rates(f"bit_rate.{name}", rate, link.bit_rate_bit_s, wanted_kbit_s, fix)
    yield from _compare_rates(f"data_bit_rate.{name}", data_rate, link.data_bit_rate_bit_s, data_kbit_s, fix_fd)


def _compare_rates(line: str, verb: str, actual_bit_s: int, expected_kbit_s: int, fix: str) -> Iterator[Finding]:
    if actual_bit_s and expected_kbit_s:
        is_right = actual_bit_s == 1000 * expected_kbit_s
        others = "" if is_right else f", its drives at {expected_kbit_s}"
        yield ok_if(is_right, line, f"{verb} {actual_bit_s / 1000:g} kbit/s{others}", fix, Level.FAIL)


def _examine_load(name: str, bus: BusParameters, drives: Sequence[DriveParameters], link: CanLink | None) -> Finding:
    """Use the interface's bit rate where it is known, or else the configured one."""
    bit_s = (link.bit_rate_bit_s if link else 0) or 1000 * bus.bit_rate_kbit_s
    load = bus_load(traffic_of(drives), bus.bit_rates._replace(nominal_bit_s=bit_s))
    text = f"{len(drives)} drives will take {load} of {bit_s / 1000:g} kbit/s"
    fix = "raise the bit rate of interface and drives to 1 Mbit/s, or put two drives on a bus of their own"
    level = Level.FAIL if load.most > MOST_FRACTION else Level.WARN
    return ok_if(load.most <= WARN_FRACTION, f"load.{name}", text, fix, level)
