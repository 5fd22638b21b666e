"""What can be said of a robot's wiring without moving anything: who talks on the buses, how often, how they are set.

Ids and rates come from what was overheard before the loop took the buses over. Then the loop stands by, asks for
versions and watchdogs, and feeds zero torque to idle drives, as the daemon does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from math import inf, isfinite, nan

from control.records import JOINTS
from drivers.can.bus_load import COMMAND_HZ, MOST_FRACTION, SLOW_HZ, TORQUE_BYTES, bus_load, frame_bits
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.odrive import codec
from drivers.odrive.axis import DriveParameters, OdriveAxis
from drivers.odrive.codec import Message, arbitration_id
from experiments.bench.lateness import BUSY
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Stand
from firmware_host.fault_monitor import FIRMWARE
from firmware_host.ticker import PERIOD_S, RATE_HZ

ASKING_S = 3.0  # longest, for versions and then for watchdogs: asked every 0.5 s
STANDING_BY_S = 0.6  # six heartbeats
COMMANDS = (  # that a drive obeys and never sends
    codec.ESTOP,
    codec.SET_AXIS_STATE,
    codec.SET_CONTROLLER_MODE,
    codec.SET_INPUT_TORQUE,
    codec.SET_LIMITS,
    codec.SET_VEL_GAINS,
    codec.CLEAR_ERRORS,
)
RATES: Mapping[str, tuple[Message, float]] = {  # message and the least rate: each tick a new one; half of the usual
    "positions": (codec.GET_ENCODER_ESTIMATES, RATE_HZ),
    "currents": (codec.GET_IQ, RATE_HZ),
    "errors": (codec.GET_ERROR, SLOW_HZ / 2.0),
    "temperatures": (codec.GET_TEMPERATURE, SLOW_HZ / 2.0),
    "voltages": (codec.GET_BUS_VOLTAGE_CURRENT, SLOW_HZ / 2.0),
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
    return sum(_is_from(frame, node_id) for frame in stand.rig.overheard.frames[bus])


def _is_from(frame: Frame, node_id: int) -> bool:
    return _is_plain(frame) and frame.arbitration_id >> 5 == node_id and not _is_command(frame)


def _is_plain(frame: Frame) -> bool:
    return not (frame.is_extended or frame.is_error or frame.is_remote)


def _is_command(frame: Frame) -> bool:
    return frame.arbitration_id & 0x1F in {message.command for message in COMMANDS}


def _whereabouts(stand: Stand, drive: DriveParameters) -> str:
    elsewhere = [bus for bus in stand.configuration.bus if bus != drive.bus and _messages_of(stand, bus, drive.node_id)]
    if elsewhere:
        return f"it is heard on {elsewhere[0]}: exchange the buses' channels, or correct the drive's bus"
    return f"check its power, wiring and termination, bit rate and node id; {SETTING_UP}"


def strangers(stand: Stand) -> Readings:
    """Nobody else on the buses, neither drives nor whoever commands them."""
    for bus, frames in stand.rig.overheard.frames.items():
        ours = {drive.node_id for drive in stand.configuration.drive.values() if drive.bus == bus}
        strange = Counter(_name_of(frame) for frame in frames if not _is_ours(frame, ours))
        most = ", ".join(name for name, _ in strange.most_common(3))
        advice = f"{most}: take it off the bus, or correct its node id" if strange else ""
        yield Reading(f"{bus}: frames of strangers", sum(strange.values()), "", 0, 0, advice)


def _is_ours(frame: Frame, node_ids: set[int]) -> bool:
    return _is_plain(frame) and frame.arbitration_id >> 5 in node_ids and not _is_command(frame)


def _name_of(frame: Frame) -> str:
    if frame.is_error:
        return "error frames (check wiring, termination and bit rate)"
    if frame.is_extended:
        return f"extended id 0x{frame.arbitration_id:x}"
    node_id = frame.arbitration_id >> 5
    return f"commands to node {node_id} from another program" if _is_command(frame) else f"node {node_id}"


def message_rates(stand: Stand) -> Readings:
    """Fresh position and current in each tick, the rest often enough to be watched."""
    for joint, drive in stand.configuration.drive.items():
        for name, (message, least_hz) in RATES.items():
            advice = f"set the drive's message period; {SETTING_UP}"
            yield Reading(f"{joint}: {name}", _rate_hz(stand, drive, message), "Hz", least_hz, inf, advice)
        usual_hz = 1.0 / drive.heartbeat_period_s
        low_hz, high_hz = (1.0 - HEARTBEAT_FRACTION) * usual_hz, (1.0 + HEARTBEAT_FRACTION) * usual_hz
        advice = f"correct drive.{joint}.heartbeat_period_s, or look for a second drive with this node id"
        yield Reading(f"{joint}: heartbeats", _rate_hz(stand, drive, codec.HEARTBEAT), "Hz", low_hz, high_hz, advice)


def _rate_hz(stand: Stand, drive: DriveParameters, message: Message) -> float:
    wanted, overheard = arbitration_id(drive.node_id, message), stand.rig.overheard
    count = sum(frame.arbitration_id == wanted and _is_plain(frame) for frame in overheard.frames[drive.bus])
    return count / overheard.duration_s


def loads(stand: Stand) -> Readings:
    """What was overheard, and the torque commands to come, each frame with as much stuffing as there can be."""
    overheard = stand.rig.overheard
    for name, bus in stand.configuration.bus.items():
        drives = sum(drive.bus == name for drive in stand.configuration.drive.values())
        bits_s = sum(_bits(frame) for frame in overheard.frames[name]) / overheard.duration_s
        bits_s += drives * COMMAND_HZ * frame_bits(TORQUE_BYTES)[1]
        fraction = bits_s / (1e3 * bus.bit_rate_kbit_s)
        reported = bus_load(drives, 1e3 * bus.bit_rate_kbit_s)
        advice = f"its drives should make {reported}: take strangers off, or raise the bit rate or the message periods"
        yield Reading(f"{name}: load with commands", 100.0 * fraction, "%", 0.0, 100.0 * MOST_FRACTION, advice)


def _bits(frame: Frame) -> int:
    """An extended identifier has 20 bits more."""
    return frame_bits(len(frame.data))[1] + 20 * frame.is_extended


def firmware(stand: Stand) -> Readings:
    """That whose messages are known."""
    _ask(stand, lambda axis: axis.version is not None)
    supported = float(f"{FIRMWARE[0]}.{FIRMWARE[1]}")
    for axis in stand.drives.axes:
        version = float(f"{axis.version.major}.{axis.version.minor}") if axis.version else nan
        advice = f"install firmware {supported}; where it is unknown, see whether requests arrive"
        yield Reading(f"{axis.joint}: firmware", version, "", supported, supported, advice)


def _ask(stand: Stand, known: Callable[[OdriveAxis], bool]) -> None:
    """Until all have answered, or will not."""
    for _ in range(round(ASKING_S / PERIOD_S)):
        if all(known(axis) for axis in stand.drives.axes):
            return
        stand.tick_soundly()


def watchdogs(stand: Stand) -> Readings:
    """On, and quick enough, by the drives' own word."""
    _ask(stand, lambda axis: isfinite(axis.watchdog_s))
    longest_s = stand.configuration.faults.longest_watchdog_s
    for axis in stand.drives.axes:
        unknown = axis.watchdog_s != axis.watchdog_s
        known = f"name the parameter numbers of firmware {axis.hardware} in [[watchdog_endpoints]]"
        advice = f"{known if unknown else 'set enable_watchdog and watchdog_timeout = 0.1, and save'}; {SETTING_UP}"
        yield Reading(f"{axis.joint}: watchdog", axis.watchdog_s, "s", 0.001, longest_s, advice)


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
    for joint, state in zip(JOINTS, stand.loop.states, strict=True):
        advice = (
            f"{codec.error_text(state.error_flags)}: mend the cause, clear it with odrivetool or 'mudskipper clear'"
        )
        yield Reading(f"{joint}: error flags", state.error_flags, "", 0, 0, advice)
    yield Reading("ticks missed", 100.0 * missed / len(samples), "%", 0.0, 100.0 * MOST_MISSED_FRACTION, BUSY)


def _trouble(port: CanPort) -> int:
    return port.error_frames + port.lost_frames + port.failed_sends
