"""The checks before arming, line by line: the list of `mudskipper check` and of a refused `arm`.

A line fails if a present fault of its part blocks arming, and shows the fault's message and advice. A `mandatory` line
also blocks arming by force. A line whose faults all follow from those of another line names it as its
`cause`.
"""

from collections.abc import Mapping, Sequence
from math import degrees, isfinite
from typing import Any

from control.fault_causes import AgedFault, group_by_cause
from control.faults import SET_UP, Blocks, Fault, FaultKind
from control.records import DriveState
from drivers.drive import DriveHealth
from firmware_host.configuration.configuration import Configuration
from firmware_host.loop import Loop
from firmware_host.operator.reports import check_item

HEARING = f"check its power, wiring, node id, type and message periods; {SET_UP}"
OTHER_TYPE = "correct its type or node_id in [drive.JOINT], or give the other drive another id"
SIGNALS = ("position", "current", "heartbeat")
MESSAGES_PER_LINE = 4  # an answer is made between two ticks
UNWATCHED = ", but never its temperature: the currents alone guard it"


def arming_checks(loop: Loop, warnings: Sequence[str]) -> list[dict[str, Any]]:
    """Return all lines, also those that permit arming."""
    lines = {"configuration": f"accepted for {loop.configuration.robot.name}"}
    for health, state in zip(loop.drives.health, loop.states, strict=True):
        lines |= _drive_lines(health, state)
    for name, port in loop.drives.ports.items():
        lost = f", {port.lost_frames} frames lost" if port.lost_frames else ""
        lines[f"bus.{name}"] = f"{port.error_frames} error frames, {port.failed_sends} failed sends{lost}"
    lines["loop"] = f"{loop.timing.rate_hz:.1f} Hz, {loop.missed_ticks} ticks missed since the start"
    lines["log"] = str(loop.recorder.path or "off")
    pose = loop.pose.report()
    if pose.source and not pose.trouble:
        lines["pose"] = pose.message
    faults = [present.fault for present in loop.aged_faults]
    if pose.trouble:  # the pose source's own text says more
        faults = [fault for fault in faults if fault.kind is not FaultKind.POSE_LOST]
    faults_of: dict[str, list[Fault]] = {}
    for fault in faults:
        faults_of.setdefault(fault.check_line, []).append(fault)
    lines = lines | {identity: "" for identity in faults_of if identity not in lines}
    joints = loop.configuration.rig.joints
    unheard = {f"drive.{joint}" for joint, state in zip(joints, loop.states, strict=True) if not state.heard}
    cause_lines = _cause_lines(loop.aged_faults, loop.configuration)
    items = []
    for identity, text in lines.items():
        own = faults_of.get(identity, [])
        items.append(_line(identity, text, own, identity in unheard) | {"cause": _cause(identity, own, cause_lines)})
    if pose.trouble:
        items.append(check_item("pose", True, pose.message, pose.what_to_do, warns=True))
    items += [check_item("configuration", True, each, "", warns=True) for each in loop.configuration.warnings]
    return items + [check_item("realtime", True, warning, "", warns=True) for warning in warnings]


def _cause_lines(faults: Sequence[AgedFault], configuration: Configuration) -> dict[Fault, str]:
    """Return the line of the cause of each fault."""
    return {
        each.fault: cause.root.check_line
        for cause in group_by_cause(faults, configuration.bus_of)
        for each in (*cause.faults, *cause.consequences)
    }


def _cause(identity: str, faults: Sequence[Fault], cause_lines: Mapping[Fault, str]) -> str:
    """Return the other line that explains every fault of a line; an empty text if there is none."""
    causes = {cause_lines[fault] for fault in faults}
    return causes.pop() if len(causes) == 1 and identity not in causes else ""


def _line(identity: str, text: str, faults: Sequence[Fault], unheard: bool) -> dict[str, Any]:
    if unheard:
        reported_as_well = (fault.message for fault in faults[:MESSAGES_PER_LINE])
        return check_item(identity, False, "; ".join([text, *reported_as_well]), HEARING)
    blocking = [fault for fault in faults if fault.kind.blocks is not Blocks.NO]
    reported = (blocking or list(faults))[:MESSAGES_PER_LINE]
    messages = " ".join(fault.message for fault in reported)
    fixes = "; ".join(dict.fromkeys(fault.kind.what_to_do for fault in reported))
    item = check_item(identity, not blocking, messages or text, fixes, warns=bool(reported) and not blocking)
    return item | {"mandatory": any(fault.kind.blocks is Blocks.ALWAYS for fault in blocking)}


def _drive_lines(health: DriveHealth, state: DriveState) -> dict[str, str]:
    """Return the lines of a drive, its joint and its watchdog."""
    joint = health.joint
    stamps_s = (state.angle_stamp_s, state.current_stamp_s, state.heartbeat_stamp_s)
    missing = [signal for signal, stamp_s in zip(SIGNALS, stamps_s, strict=True) if not isfinite(stamp_s)]
    if missing:
        other = f"; {health.other_protocol} answers under its id: {OTHER_TYPE}" if health.other_protocol else ""
        return {f"drive.{joint}": f"not heard: no {', '.join(missing)} yet{other}"}
    unwatched = not isfinite(state.temperature_c)  # never arrived, or the drive has no sensor and says so by NaN
    heat = f", {state.temperature_c:.0f} degrees C" if isfinite(state.temperature_c) else ""
    lines = {
        f"drive.{joint}": f"heard, firmware {health.firmware or 'unknown'}{UNWATCHED if unwatched else ''}",
        f"joint.{joint}": f"at {degrees(state.angle_rad):.1f} degrees{heat}",
    }
    if isfinite(health.watchdog_s):
        lines[f"watchdog.{joint}"] = f"trips after {health.watchdog_s:g} s" if health.watchdog_s else "off"
    return lines
