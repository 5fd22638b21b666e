"""The text of each fault: what it means, what happened this time, and what to do; and of each refused request.

A message is a template over the fault's subject and measured values. A fault that carries a `reason`, such as a
drive's own error text or an operating system's, shows it at the end of its message.
"""

from collections.abc import Callable
from math import isfinite
from typing import NamedTuple

from control.faults import Fault, FaultKind
from control.modes import Mode, Refusal, Request

SET_UP = "see the guide to set up its type of drive (docs/how-to)"
WIRING = f"check its power, wiring, node id and message periods; {SET_UP}"
FIX = "fix the cause, then 'mudskipper clear'"
COOL = "let it cool; walk less deep or slower"
REPORT = "this is a bug: keep the log, report it, and restart the daemon"
WIRES = "check wiring, termination and bit rate; 'ip -s -d link show' shows the error counters"
BUSY = "end other programs on this computer; 'mudskipper check' shows real-time warnings"
DISOBEYS = "check motor phases, encoder and cables; end other programs that command it; then 'mudskipper clear'"
ENCODER = "check encoder, magnet and cable, then 'mudskipper clear'"
OTHERS = "end other programs that command it; look for late or lost commands; then 'mudskipper clear'"
SAME = ""


class FaultText(NamedTuple):
    meaning: str  # the fault in general, for the documentation
    message: str | Callable[[Fault], str]  # what happened, over `subject` and the fault's values; SAME as the meaning
    what_to_do: str  # continues a sentence: no capital letter, no full stop


def _silence(signal: str) -> Callable[[Fault], str]:
    """Make the message about a missing signal; an infinite age means that it never arrived."""

    def message(fault: Fault) -> str:
        age_s = float(dict(fault.values)["age_s"])
        how_long = f"for {age_s * 1e3:.0f} ms" if isfinite(age_s) else "at all"
        return f"No {signal} came from the {fault.subject} drive {how_long}."

    return message


def _late(fault: Fault) -> str:
    return _silence(str(dict(fault.values)["signal"]))(fault)


def _stuck(fault: Fault) -> str:
    attempts = dict(fault.values)["attempts"]
    flippers = f"The {fault.subject} flipper is" if fault.subject else "Both flippers are"
    return f"{flippers} stuck in the mud after {attempts} attempt{'' if attempts == 1 else 's'}."


FAULT_TEXTS: dict[FaultKind, FaultText] = {
    FaultKind.DRIVE_LATE: FaultText("Position or current is older than two ticks.", _late, WIRING),
    FaultKind.DRIVE_QUIET: FaultText("Neither position nor current came for three ticks.", _silence("message"), WIRING),
    FaultKind.DRIVE_SILENT: FaultText("Neither position nor current came for ten ticks.", _silence("message"), WIRING),
    FaultKind.POSITION_STALE: FaultText("No position came for three ticks.", _silence("position"), WIRING),
    FaultKind.POSITION_SILENT: FaultText("No position came for ten ticks.", _silence("position"), WIRING),
    FaultKind.CURRENT_STALE: FaultText("No current came for three ticks.", _silence("current"), WIRING),
    FaultKind.CURRENT_SILENT: FaultText("No current came for ten ticks.", _silence("current"), WIRING),
    FaultKind.HEARTBEAT_SILENT: FaultText("No heartbeat came for 0.5 s.", _silence("heartbeat"), WIRING),
    FaultKind.TEMPERATURE_SILENT: FaultText("No temperature came for 1 s.", _silence("temperature"), WIRING),
    FaultKind.VOLTAGE_SILENT: FaultText("No bus voltage came for 1 s.", _silence("bus voltage"), WIRING),
    FaultKind.DRIVE_ERROR: FaultText("A drive reports an error.", "The {subject} drive reports error {flags}.", FIX),
    FaultKind.DRIVE_DISARMED: FaultText(
        "A drive left closed loop by itself.", "The {subject} drive left closed loop by itself.", FIX
    ),
    FaultKind.DRIVE_ENERGISED: FaultText(
        "A drive is energised although the robot is not armed.",
        "The {subject} drive is {activity} although the robot is not armed.",
        "end other programs that command it, or 'mudskipper disarm'",
    ),
    FaultKind.DRIVE_RESTARTED: FaultText(
        "A drive restarted.",
        "The {subject} drive restarted.",
        "check its supply and its joint's angle, then 'mudskipper clear'",
    ),
    FaultKind.DRIVE_VERSION: FaultText(
        "A drive's firmware is unknown or not supported.",
        "The {subject} drive's firmware is {version}; {supported} is supported.",
        "install a supported firmware",
    ),
    FaultKind.DUPLICATE_NODE_ID: FaultText(
        "Two drives on a bus send under one node id.",
        "Two drives send under the node id of the {subject} drive.",
        "give every drive on a bus a node id of its own, one at a time",
    ),
    FaultKind.WRONG_DRIVE: FaultText(
        "A drive has another serial number than configured.",
        "The {subject} drive's serial number is {serial}, not {expected}.",
        "connect the right drive, or calibrate this one and write its serial_number into [drive.JOINT]",
    ),
    FaultKind.DRIVE_SETTINGS: FaultText(
        "A drive's settings differ from the configuration.", "The settings of the {subject} drive do not fit.", SET_UP
    ),
    FaultKind.FOREIGN_COMMANDS: FaultText(
        "Another program commands a drive.", "Another program sent {commands} commands to {subject}.", OTHERS
    ),
    FaultKind.SETPOINT_MISMATCH: FaultText(
        "A drive follows other torques than commanded.", "{subject} follows other torques than commanded.", OTHERS
    ),
    FaultKind.WATCHDOG_UNKNOWN: FaultText(
        "A drive's watchdog is unknown.", "The {subject} drive's watchdog is unknown.", f"{SET_UP}, or arm with --force"
    ),
    FaultKind.WATCHDOG_OFF: FaultText(
        "A drive's watchdog is off or too slow.",
        "The {subject} drive's watchdog is {setting}; it must trip within {longest_s:g} s.",
        f"set the drive's watchdog to 0.1 s, and save; {SET_UP}",
    ),
    FaultKind.ARMING_FAILED: FaultText(
        "A drive did not go into closed loop.", "{subject} did not go into closed loop within {longest_s:g} s.", FIX
    ),
    FaultKind.BUS_WARNING: FaultText(
        "A bus controller counts many errors.", "The {subject} bus has many errors.", WIRES
    ),
    FaultKind.BUS_PASSIVE: FaultText(
        "A bus controller is error-passive.", "The {subject} bus has so many errors that it is error-passive.", WIRES
    ),
    FaultKind.BUS_OFF: FaultText("A bus controller has left the bus.", "The {subject} bus is off.", WIRES),
    FaultKind.BUS_REFUSES: FaultText(
        "Commands were lost in three ticks in a row.",
        "The {subject} bus lost commands in {ticks} ticks in a row.",
        WIRES,
    ),
    FaultKind.FRAMES_LOST: FaultText(
        "Frames came faster than they were read.",
        "{frames} frames of the {subject} bus were lost: they came faster than they were read.",
        BUSY,
    ),
    FaultKind.JOINT_POSITION: FaultText(
        "A joint is outside of its range.",
        "The {subject} joint is at {angle_deg:.1f} degrees, outside of {low_deg:.0f} to {high_deg:.0f}.",
        "move it back by hand, then 'mudskipper clear'",
    ),
    FaultKind.JOINT_VELOCITY: FaultText(
        "A joint is faster than its limit allows.",
        "The {subject} joint turns at {velocity_rad_s:.0f} rad/s; the limit is {limit_rad_s:.0f} rad/s.",
        FIX,
    ),
    FaultKind.JOINT_MOVING: FaultText(
        "A joint moves while torque is off.",
        "The {subject} joint moves while torque is off.",
        "wait until it is at rest",
    ),
    FaultKind.JOINT_CURRENT: FaultText(
        "A motor takes more current than its limit.",
        "The {subject} motor takes {current_a:.1f} A; the limit is {limit_a:.1f} A.",
        "check current limits and torque constant, then 'mudskipper clear'",
    ),
    FaultKind.JOINT_NOT_FOLLOWING: FaultText(
        "A joint stands still at full torque for 2 s.",
        "The {subject} joint stands still at full torque for {stalled_s:.1f} s.",
        "free the joint, then 'mudskipper clear'",
    ),
    FaultKind.JOINT_RUNAWAY: FaultText(
        "A joint gains energy that its motor was not commanded to give.",
        "The {subject} joint gained {energy_j:.2f} J without a command; the limit is {limit_j:.2f} J.",
        DISOBEYS,
    ),
    FaultKind.JOINT_OSCILLATING: FaultText(
        "A joint keeps moving away from its commanded path.",
        "The {subject} joint moved away from its commanded path by {away_rad:.2f} rad in all within 0.3 s.",
        f"lower the stiffness in [gains], or {DISOBEYS}",
    ),
    FaultKind.FOLLOWING_ERROR: FaultText(
        "A joint in air does not follow its commanded path.",
        "The {subject} joint is {error_rad:.2f} rad off its commanded path in air; the limit is {limit_rad:.2f} rad.",
        "free the joint, check motor and encoder, then 'mudskipper clear'",
    ),
    FaultKind.DAMPING_FAILED: FaultText(
        "A motor's current does not fit its damping torque for 0.1 s.",
        "The {subject} motor gives {measured_nm:.2f} N·m instead of the damping torque of {commanded_nm:.2f} N·m.",
        DISOBEYS,
    ),
    FaultKind.ENCODER_JUMP: FaultText(
        "A position jumped farther than a joint can move.",
        "The {subject} encoder jumped by {step_deg:.0f} degrees in {gap_ms:.1f} ms.",
        ENCODER,
    ),
    FaultKind.ENCODER_STUCK: FaultText(
        "A position stands still while joint or torque change.",
        "The {subject} encoder stands still while the joint moves or its torque changes.",
        ENCODER,
    ),
    FaultKind.TORQUE_MISSING: FaultText(
        "A motor's current does not fit its torque command for 0.1 s.",
        "The {subject} motor gives {measured_nm:.2f} N·m instead of {commanded_nm:.2f} N·m.",
        "check the drive's limits, its torque constant and cables, then 'mudskipper clear'",
    ),
    FaultKind.MOTOR_OVERHEATING: FaultText(
        "A motor is nearly too hot.", "The {subject} motor has {temperature_c:.0f} degrees C.", COOL
    ),
    FaultKind.MOTOR_HOT: FaultText(
        "A motor is too hot.", "The {subject} motor has {temperature_c:.0f} degrees C.", COOL
    ),
    FaultKind.WINDING_OVERHEATING: FaultText(
        "A winding is nearly too hot, estimated from its currents.",
        "The {subject} motor's winding has {temperature_c:.0f} degrees C, estimated from its currents.",
        COOL,
    ),
    FaultKind.WINDING_HOT: FaultText(
        "A winding is too hot, estimated from its currents.",
        "The {subject} motor's winding has {temperature_c:.0f} degrees C, estimated from its currents.",
        COOL,
    ),
    FaultKind.VOLTAGE_LOW: FaultText(
        "The supply voltage is low.",
        "The {subject} drive has only {voltage_v:.1f} V.",
        "charge or change the battery",
    ),
    FaultKind.VOLTAGE_UNDER: FaultText(
        "The supply voltage is too low.",
        "The {subject} drive has {voltage_v:.1f} V; the minimum is {least_v:g} V.",
        "charge or change the battery",
    ),
    FaultKind.FLIPPER_STUCK: FaultText(
        "A flipper is still stuck in the mud after every attempt to free it.",
        _stuck,
        "free it by hand, then 'mudskipper clear', and walk less deep",
    ),
    FaultKind.TORQUE_NOT_FINITE: FaultText("A torque was not a finite number.", SAME, REPORT),
    FaultKind.COMMAND_REFUSED: FaultText("The transmit gate refused a command.", SAME, REPORT),
    FaultKind.LOOP_OVERRUN: FaultText("The loop missed a tick.", "The loop missed {missed} of its ticks.", BUSY),
    FaultKind.LOOP_LAGGING: FaultText(
        "The loop missed six ticks in a row, or a tenth of a hundred.",
        "The loop lags: {extent}.",
        BUSY,
    ),
    FaultKind.LOOP_CRAWLING: FaultText(
        "Commands are sent too rarely to brake a joint.", "The loop's ticks take {tick_ms:.0f} ms.", BUSY
    ),
    FaultKind.LOOP_STALLED: FaultText("The loop stood still.", "The loop stood still for {late_ms:.0f} ms.", BUSY),
    FaultKind.CLOCK_STEP: FaultText(
        "The computer's wall clock was set.",
        "The computer's wall clock was set by {step_s:+.1f} s.",
        "do nothing: control uses another clock; dates in the log may jump",
    ),
    FaultKind.ESTIMATE_WILD: FaultText(
        "An estimated coefficient is beyond what any mud has.",
        "Stride {stride} of the {subject} flipper gave a coefficient beyond what any mud has.",
        "look at the strides in the log; the next depth is the first one of the walk",
    ),
    FaultKind.POSE_LOST: FaultText(
        "The body's position is no longer reported.", SAME, "check the motion capture and its bridge"
    ),
    FaultKind.LEASE_LOST: FaultText(
        "The program that held the lease disconnected or did not renew it.",
        "{holder} held the lease and did not renew it.",
        "make the robot safe, then arm again",
    ),
    FaultKind.DISK_LOW: FaultText(
        "The log's disk is nearly full.",
        "The log's disk has {free_percent:.1f} % free ({free_mb:.0f} MB).",
        "free space on the log's disk, or lower log.quota_bytes",
    ),
    FaultKind.LOG_UNWRITABLE: FaultText(
        "The log cannot be written.",
        SAME,
        "fix what the message names: the log's folder, its permissions, or its disk",
    ),
    FaultKind.DISK_SLOW: FaultText(
        "The log's disk is slow.", "One write to the log's disk took {write_s:.1f} s.", "use another card or disk"
    ),
    FaultKind.RECORDER_DEAD: FaultText("The log's writer has died: nothing is recorded.", SAME, "restart the daemon"),
    FaultKind.ROWS_LOST: FaultText(
        "The log lost rows.", "The log has lost {rows} rows so far.", "use another card or disk"
    ),
}


def fault_message(fault: Fault) -> str:
    """Return what happened, in whole sentences.

    A fault without the values that its message shows is described in general: no text may stop the loop.
    """
    text = FAULT_TEXTS[fault.kind]
    try:
        return exact_message(fault)
    except (KeyError, ValueError):
        return f"{text.meaning} ({fault.subject})" if fault.subject else text.meaning


def exact_message(fault: Fault) -> str:
    """Return the message with its values; raises KeyError or ValueError if one is missing or is no number."""
    text, values = FAULT_TEXTS[fault.kind], dict(fault.values)
    template = text.message or text.meaning
    message = template(fault) if callable(template) else template.format(subject=fault.subject, **values)
    reason = str(values.get("reason", "")).rstrip(".")
    return f"{message.rstrip('.')}: {reason}." if reason else message


def what_to_do(fault: Fault) -> str:
    """Return the advice, to continue a sentence."""
    return FAULT_TEXTS[fault.kind].what_to_do


def fault_advice(fault: Fault) -> str:
    """Return what happened, and what to do."""
    to_do = what_to_do(fault)
    return f"{fault_message(fault)} {to_do[:1].upper()}{to_do[1:]}."


IN_MODE: dict[Mode, str] = {
    Mode.BOOT: "not every drive was heard yet; see 'mudskipper check'",
    Mode.IDLE: "the drives are idle; 'mudskipper arm' first",
    Mode.ARMING: "the drives are being armed; try again in a moment",
    Mode.HOLD: "the robot already holds its pose",
    Mode.WALKING: "the robot walks; 'mudskipper stop' first",
    Mode.STOPPING: "the robot is stopping; try again in a moment",
    Mode.FAULT: "a fault is present; read 'mudskipper status', then 'mudskipper clear'",
    Mode.DAMPING: "a fault lets the joints sink; wait until they rest",
}


def refusal_text(refusal: Refusal) -> str:
    """Return why the robot refuses a request in its present mode, and what to do."""
    if refusal.faults:
        return " ".join(fault_message(fault) for fault in refusal.faults)
    if refusal.request is Request.CLEAR and refusal.mode is Mode.HOLD:
        return "nothing to clear: the robot holds its pose"
    return IN_MODE[refusal.mode]
