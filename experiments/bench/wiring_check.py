"""Checks the wiring without any motion: the ids on the buses, their message rates, and the settings of the drives.

Ids and rates come from the frames recorded before the loop opened the buses. Then the loop waits, requests
versions and watchdogs, and feeds zero torque to idle drives, as the daemon does.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from math import inf, isfinite, isnan, nan
from typing import NamedTuple

from control.rate import PERIOD_S, RATE_HZ
from drivers.can.bus_load import MOST_FRACTION, FrameRate, bus_load
from drivers.can.can_port import CanPort
from drivers.drive import DriveHealth
from drivers.drive_types import read_frame, traffic_of, type_of
from experiments.bench.lateness import BUSY
from experiments.bench.reading import BenchReading, BenchReadings, left_out
from experiments.bench.test_rig import TestRig

ASKING_S = 3.0  # longest, for versions and then for watchdogs: asked every 0.5 s
STANDING_BY_S = 0.6  # six heartbeats
SLOW_LEAST_HZ = 5.0  # half of the usual
RATES = {  # signal and its least rate: a new position and current in each tick
    "positions": ("position", RATE_HZ),
    "currents": ("current", RATE_HZ),
    "errors": ("error", SLOW_LEAST_HZ),
    "temperatures": ("temperature", SLOW_LEAST_HZ),
    "voltages": ("voltage", SLOW_LEAST_HZ),
}
ANSWERED_HZ = 0.95 * RATE_HZ  # of drives that are asked in every tick
HEARTBEAT_FRACTION = 0.3  # by which a rate of some ten in a second may be off; two drives of one id send twice as many
MOST_MISSED_FRACTION = 0.01  # of ticks: more, and this computer is too slow or too busy to measure with
SETTING_UP = "see the guide to set up its type of drive (docs/how-to)"


class Sender(NamedTuple):
    """What one recorded frame says of its sender."""

    name: str
    node_id: int | None = None  # where a drive sent it
    signals: tuple[str, ...] = ()  # that it reports, the main one first


def _senders(test_rig: TestRig, bus: str) -> Iterator[Sender]:
    drives = [drive for drive in test_rig.configuration.drive.values() if drive.bus == bus]
    for frame in test_rig.rig.overheard.frames[bus]:
        content = read_frame(frame, drives)
        if frame.is_error:
            yield Sender("error frames (check wiring, termination and bit rate)")
        elif content is None:
            yield Sender(f"{'extended ' if frame.is_extended else ''}id 0x{frame.arbitration_id:x}")
        elif content.is_command:
            yield Sender(f"commands to node {content.node_id} from another program")
        else:
            yield Sender(f"node {content.node_id}", None if frame.is_remote else content.node_id, content.signals)


def _rate_hz(test_rig: TestRig, bus: str, node_id: int, signal: str = "") -> float:
    """Return the rate of a drive's messages, or of those whose main signal this is."""
    messages = [sender for sender in _senders(test_rig, bus) if sender.node_id == node_id]
    return sum(signal in ("", *message.signals[:1]) for message in messages) / test_rig.rig.overheard.duration_s


def check_ids(test_rig: TestRig) -> BenchReadings:
    """Check that every drive is heard under its id on its bus."""
    for joint, drive in test_rig.configuration.drive.items():
        elsewhere = [
            bus for bus in test_rig.configuration.bus if bus != drive.bus and _rate_hz(test_rig, bus, drive.node_id)
        ]
        advice = f"check its power, wiring and termination, bit rate and node id; {SETTING_UP}"
        if elsewhere:
            advice = f"it is heard on {elsewhere[0]}: exchange the buses' channels, or correct the drive's bus"
        what = f"{joint}: messages of node {drive.node_id} on {drive.bus}"
        yield BenchReading(what, _rate_hz(test_rig, drive.bus, drive.node_id), "Hz", 1.0, inf, advice)


def check_unknown_ids(test_rig: TestRig) -> BenchReadings:
    """Check that no other drive or program sends on the buses."""
    for bus in test_rig.rig.overheard.frames:
        ours = {drive.node_id for drive in test_rig.configuration.drive.values() if drive.bus == bus}
        unknown = Counter(sender.name for sender in _senders(test_rig, bus) if sender.node_id not in ours)
        most = ", ".join(name for name, _ in unknown.most_common(3))
        advice = f"{most}: take it off the bus, or correct its node id" if unknown else ""
        yield BenchReading(f"{bus}: frames of unknown senders", unknown.total(), "", 0, 0, advice)


def check_message_rates(test_rig: TestRig) -> BenchReadings:
    """Check that position and current are new in each tick, and other messages frequent enough for monitoring."""
    for joint, drive in test_rig.configuration.drive.items():
        rate_hz = partial(_rate_hz, test_rig, drive.bus, drive.node_id)
        if type_of(drive).query(drive.node_id) is not None:
            advice = f"look for lost frames and late answers; {SETTING_UP}"
            yield BenchReading(f"{joint}: answers", rate_hz("position"), "Hz", ANSWERED_HZ, inf, advice)
            continue
        for name, (signal, least_hz) in RATES.items():
            if signal not in drive.unreported:
                advice = f"set the drive's message period; {SETTING_UP}"
                yield BenchReading(f"{joint}: {name}", rate_hz(signal), "Hz", least_hz, inf, advice)
        usual_hz = 1.0 / drive.heartbeat_period_s
        low_hz, high_hz = (1.0 - HEARTBEAT_FRACTION) * usual_hz, (1.0 + HEARTBEAT_FRACTION) * usual_hz
        advice = f"correct drive.{joint}.heartbeat_period_s, or look for a second drive with this node id"
        yield BenchReading(f"{joint}: heartbeats", rate_hz("heartbeat"), "Hz", low_hz, high_hz, advice)


def check_bus_loads(test_rig: TestRig) -> BenchReadings:
    """Check the load of the recorded frames and the coming torque commands, with the largest bit stuffing."""
    overheard = test_rig.rig.overheard
    for name, bus in test_rig.configuration.bus.items():
        drives = [drive for drive in test_rig.configuration.drive.values() if drive.bus == name]
        commands = [type_of(drive).command for drive in drives]
        frames = overheard.frames[name]
        heard = [FrameRate(len(each.data), 1.0 / overheard.duration_s, each.is_extended, each.is_fd) for each in frames]
        fraction = bus_load([*heard, *commands], bus.bit_rates).most
        reported = bus_load(traffic_of(drives), bus.bit_rates)
        advice = f"its drives should cause {reported}: remove other senders, or raise bit rate or message periods"
        yield BenchReading(f"{name}: load with commands", 100.0 * fraction, "%", 0.0, 100.0 * MOST_FRACTION, advice)


def ask_drives(test_rig: TestRig, known: Callable[[DriveHealth], bool]) -> Iterator[DriveHealth]:
    """Wait until all drives that report their settings have answered, or for the longest time; yield all of them."""
    readable = readable_joints(test_rig)
    for _ in range(round(ASKING_S / PERIOD_S)):
        if all(known(health) or health.joint not in readable for health in test_rig.drives.health):
            break
        test_rig.tick_checked()
    yield from test_rig.drives.health


def readable_joints(test_rig: TestRig) -> set[str]:
    """Return the joints whose drives report version and watchdog."""
    return {joint for joint, drive in test_rig.configuration.drive.items() if drive.reports_settings}


def check_firmware(test_rig: TestRig) -> BenchReadings:
    """Check that the firmware version is supported."""
    readable = readable_joints(test_rig)
    for health in ask_drives(test_rig, lambda health: bool(health.firmware)):
        if health.joint not in readable:
            yield left_out(f"{health.joint}: firmware supported")
            continue
        supported = float(health.firmware_supported) if health.firmware else nan
        advice = (
            f"it is {health.firmware or 'unknown'}: install {health.supported_firmware}, or see whether requests arrive"
        )
        yield BenchReading(f"{health.joint}: firmware supported", supported, "", 1, 1, advice)


def check_watchdogs(test_rig: TestRig) -> BenchReadings:
    """Check that the drives report a watchdog with a short enough timeout."""
    readable, longest_s = readable_joints(test_rig), test_rig.configuration.faults.longest_watchdog_s
    for health in ask_drives(test_rig, lambda health: isfinite(health.watchdog_s)):
        if health.joint not in readable:  # stage 5 measures it
            yield left_out(f"{health.joint}: watchdog")
            continue
        set_it = "set enable_watchdog and watchdog_timeout = 0.1, and save"
        advice = f"{health.watchdog_advice if isnan(health.watchdog_s) else set_it}; {SETTING_UP}"
        yield BenchReading(f"{health.joint}: watchdog", health.watchdog_s, "s", 0.001, longest_s, advice)


def check_quiet_buses(test_rig: TestRig) -> BenchReadings:
    """Check for lost frames, drive errors and missed ticks."""
    test_rig.tick()  # ends the pause of a prompt or of another test
    before = {name: _trouble(port) for name, port in test_rig.drives.ports.items()}
    missed, samples = test_rig.loop.missed_ticks, test_rig.run_for(STANDING_BY_S)
    missed = test_rig.loop.missed_ticks - missed
    wires = "check wiring, termination and bit rate; see 'ip -s -d link show'"
    for name, port in test_rig.drives.ports.items():
        lost = _trouble(port) - before[name]
        reported = port.last_error or port.last_send_error
        yield BenchReading(f"{name}: errors and losses", lost, "", 0, 0, f"{reported}: {wires}" if reported else wires)
    for health, state in zip(test_rig.drives.health, test_rig.loop.states, strict=True):
        advice = f"{health.active_errors}: fix the cause, clear it with odrivetool or 'mudskipper clear'"
        yield BenchReading(f"{health.joint}: error flags", state.error_flags, "", 0, 0, advice)
    yield BenchReading("ticks missed", 100.0 * missed / len(samples), "%", 0.0, 100.0 * MOST_MISSED_FRACTION, BUSY)


def _trouble(port: CanPort) -> int:
    return port.error_frames + port.lost_frames + port.failed_sends


CHECKS = (
    check_ids,
    check_unknown_ids,
    check_message_rates,
    check_bus_loads,
    check_firmware,
    check_watchdogs,
    check_quiet_buses,
)
