"""What can be said of a robot's wiring without moving anything: who talks on the buses, how often, how they are set.

Ids and rates come from what was overheard before the loop took the buses over. Then the loop stands by, asks for
versions and watchdogs, and feeds zero torque to idle drives, as the daemon does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import inf, isfinite, isnan, nan

from control.rate import PERIOD_S, RATE_HZ
from drivers.can.bus_load import MOST_FRACTION, bus_load, frame_bits
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.drive import DriveHealth, DriveParameters, FrameContent
from drivers.drive_types import traffic_of, type_of
from experiments.bench.lateness import BUSY
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Stand

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
HEARTBEAT_FRACTION = 0.3  # by which a rate of some ten in a second may be off; two drives of one id send twice as many
MOST_MISSED_FRACTION = 0.01  # of ticks: more, and this computer is too slow or too busy to measure with
SETTING_UP = "see docs/how-to/odrive.md"


def ids_heard(stand: Stand) -> Readings:
    """Every drive under its id on its bus."""
    for joint, drive in stand.configuration.drive.items():
        rate_hz = _messages_of(stand, drive.bus, drive.node_id) / stand.rig.overheard.duration_s
        yield Reading(
            f"{joint}: messages of node {drive.node_id} on {drive.bus}",
            rate_hz,
            "Hz",
            1.0,
            inf,
            _whereabouts(stand, drive),
        )


def _messages_of(stand: Stand, bus: str, node_id: int) -> int:
    return sum(_is_ours(stand, frame, {node_id}) for frame in stand.rig.overheard.frames[bus])


def _content(stand: Stand, frame: Frame) -> FrameContent | None:
    return type_of(stand.configuration.drive.values()).read_frame(frame)


def _whereabouts(stand: Stand, drive: DriveParameters) -> str:
    elsewhere = [bus for bus in stand.configuration.bus if bus != drive.bus and _messages_of(stand, bus, drive.node_id)]
    if elsewhere:
        return f"it is heard on {elsewhere[0]}: exchange the buses' channels, or correct the drive's bus"
    return f"check its power, wiring and termination, bit rate and node id; {SETTING_UP}"


def strangers(stand: Stand) -> Readings:
    """Nobody else on the buses, neither drives nor whoever commands them."""
    for bus, frames in stand.rig.overheard.frames.items():
        ours = {drive.node_id for drive in stand.configuration.drive.values() if drive.bus == bus}
        strange = Counter(_name_of(stand, frame) for frame in frames if not _is_ours(stand, frame, ours))
        most = ", ".join(name for name, _ in strange.most_common(3))
        advice = f"{most}: take it off the bus, or correct its node id" if strange else ""
        yield Reading(f"{bus}: frames of strangers", sum(strange.values()), "", 0, 0, advice)


def _is_ours(stand: Stand, frame: Frame, node_ids: set[int]) -> bool:
    """Whether one of these drives sent it."""
    content = None if frame.is_remote else _content(stand, frame)
    return content is not None and content.node_id in node_ids and not content.is_command


def _name_of(stand: Stand, frame: Frame) -> str:
    if frame.is_error:
        return "error frames (check wiring, termination and bit rate)"
    content = _content(stand, frame)
    if content is None:
        return f"{'extended ' if frame.is_extended else ''}id 0x{frame.arbitration_id:x}"
    by_a_program = f"commands to node {content.node_id} from another program"
    return by_a_program if content.is_command else f"node {content.node_id}"


def message_rates(stand: Stand) -> Readings:
    """Fresh position and current in each tick, the rest often enough to be watched."""
    for joint, drive in stand.configuration.drive.items():
        for name, (signal, least_hz) in RATES.items():
            advice = f"set the drive's message period; {SETTING_UP}"
            yield Reading(f"{joint}: {name}", _rate_hz(stand, drive, signal), "Hz", least_hz, inf, advice)
        usual_hz = 1.0 / drive.heartbeat_period_s
        low_hz, high_hz = (1.0 - HEARTBEAT_FRACTION) * usual_hz, (1.0 + HEARTBEAT_FRACTION) * usual_hz
        advice = f"correct drive.{joint}.heartbeat_period_s, or look for a second drive with this node id"
        yield Reading(f"{joint}: heartbeats", _rate_hz(stand, drive, "heartbeat"), "Hz", low_hz, high_hz, advice)


def _rate_hz(stand: Stand, drive: DriveParameters, signal: str) -> float:
    """The rate of the messages whose main signal this is."""
    overheard = stand.rig.overheard
    contents = [_content(stand, frame) for frame in overheard.frames[drive.bus] if not frame.is_remote]
    count = sum(
        each is not None and (each.node_id, each.signals[:1]) == (drive.node_id, (signal,)) for each in contents
    )
    return count / overheard.duration_s


def loads(stand: Stand) -> Readings:
    """What was overheard, and the torque commands to come, each frame with as much stuffing as there can be."""
    overheard = stand.rig.overheard
    for name, bus in stand.configuration.bus.items():
        drives = [drive for drive in stand.configuration.drive.values() if drive.bus == name]
        commands = [type_of(drives).command for _ in drives]
        bits_s = sum(_bits(frame) for frame in overheard.frames[name]) / overheard.duration_s
        bits_s += sum(command.rate_hz * frame_bits(command.data_bytes)[1] for command in commands)
        fraction = bits_s / (1e3 * bus.bit_rate_kbit_s)
        reported = bus_load(traffic_of(drives), 1e3 * bus.bit_rate_kbit_s)
        advice = f"its drives should make {reported}: take strangers off, or raise the bit rate or the message periods"
        yield Reading(f"{name}: load with commands", 100.0 * fraction, "%", 0.0, 100.0 * MOST_FRACTION, advice)


def _bits(frame: Frame) -> int:
    """An extended identifier has 20 bits more."""
    return frame_bits(len(frame.data))[1] + 20 * frame.is_extended


def firmware(stand: Stand) -> Readings:
    """That whose messages are known."""
    _ask(stand, lambda health: bool(health.firmware))
    for health in stand.drives.health:
        version, supported = _major_and_minor(health.firmware), float(health.supported_firmware)
        advice = f"install firmware {supported}; where it is unknown, see whether requests arrive"
        yield Reading(f"{health.joint}: firmware", version, "", supported, supported, advice)


def _major_and_minor(version: str) -> float:
    """0.6 of version 0.6.11; NaN where it is unknown."""
    return float(".".join(version.split(".")[:2])) if version else nan


def _ask(stand: Stand, known: Callable[[DriveHealth], bool]) -> None:
    """Until all have answered, or will not."""
    for _ in range(round(ASKING_S / PERIOD_S)):
        if all(known(health) for health in stand.drives.health):
            return
        stand.tick_soundly()


def watchdogs(stand: Stand) -> Readings:
    """On, and quick enough, by the drives' own word."""
    _ask(stand, lambda health: isfinite(health.watchdog_s))
    longest_s = stand.configuration.faults.longest_watchdog_s
    for health in stand.drives.health:
        set_it = "set enable_watchdog and watchdog_timeout = 0.1, and save"
        advice = f"{health.watchdog_advice if isnan(health.watchdog_s) else set_it}; {SETTING_UP}"
        yield Reading(f"{health.joint}: watchdog", health.watchdog_s, "s", 0.001, longest_s, advice)


def quiet_buses(stand: Stand) -> Readings:
    """Nothing lost in either direction, no drive in error, and a computer that keeps up."""
    stand.tick()  # whatever came before it: questions, another test
    before = {name: _trouble(port) for name, port in stand.drives.ports.items()}
    missed, samples = stand.loop.missed_ticks, stand.run_for(STANDING_BY_S)
    missed = stand.loop.missed_ticks - missed
    wires = "check wiring, termination and bit rate; 'ip -s -d link show' tells more"
    for name, port in stand.drives.ports.items():
        lost = _trouble(port) - before[name]
        reported = port.last_error or port.last_send_error
        yield Reading(f"{name}: errors and losses", lost, "", 0, 0, f"{reported}: {wires}" if reported else wires)
    for health, state in zip(stand.drives.health, stand.loop.states, strict=True):
        advice = f"{health.active_errors}: mend the cause, clear it with odrivetool or 'mudskipper clear'"
        yield Reading(f"{health.joint}: error flags", state.error_flags, "", 0, 0, advice)
    yield Reading("ticks missed", 100.0 * missed / len(samples), "%", 0.0, 100.0 * MOST_MISSED_FRACTION, BUSY)


def _trouble(port: CanPort) -> int:
    return port.error_frames + port.lost_frames + port.failed_sends
