"""Faults as data: a fault is one row of `FaultKind`, with the robot's reaction to it and the texts that people read.

The modes know reactions only, never single faults: the worst reaction wins. A new fault is its row here, and the line
that detects it: in firmware_host/fault_monitor.py, or in a monitor of control/monitors/.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, IntEnum, StrEnum
from math import isfinite
from typing import NamedTuple


class Reaction(IntEnum):
    """How hard the robot reacts, from mild to hard; the largest number of all present faults counts."""

    NONE = 0  # the fault only blocks arming
    WARN = 1  # the fault is reported and logged, nothing else
    HOLD = 2  # a walk ends where it is: the measured pose is held
    SOFT_STOP = 3  # flippers are raised, for 3 s at most, then the drives go idle
    DAMPING = 4  # no stiffness, only damping, until the joints are at rest, then the drives go idle
    DRIVES_IDLE = 5  # at once


class Blocks(IntEnum):
    """Whether a present fault blocks arming."""

    NO = 0
    UNLESS_FORCED = 1
    ALWAYS = 2


class Clears(Enum):
    """What ends a fault that occurred with torque on, or that `latches_idle`. Any other one ends with its cause."""

    WHEN_GONE = "when its cause has been gone for a while"
    BY_HAND = "by 'mudskipper clear', once its cause is gone"
    BY_RESTART = "by a restart of the daemon: it is a bug"


NONE, WARN, HOLD, SOFT_STOP, DAMPING, DRIVES_IDLE = Reaction
NO, UNLESS_FORCED, ALWAYS = Blocks
WHEN_GONE, BY_HAND, BY_RESTART = Clears


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
THEN_CLEAR = "; then 'mudskipper clear'"
COOL_AND_CLEAR = "let it cool, then 'mudskipper clear'; walk less deep or slower"
SAME = ""


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


class FaultKind(StrEnum):
    """Every fault that the robot can detect.

    A row has in its first line: name, line of `mudskipper check` that it belongs to, reaction, blocking of arming,
    clearing, and bound. The bound is the largest number of 380 Hz ticks from the cause to the reaction, with the
    default bounds of [faults] and drives that send position and current every 2 ms and everything else every 100 ms.
    Then follow the texts: the fault in general, for the documentation; what happened this time, a template over
    `subject` and the fault's values, or SAME as in general; and what to do, without capital letter and full stop.
    """

    part: str
    reaction: Reaction
    blocks: Blocks
    clears: Clears
    bound_ticks: int
    meaning: str
    template: str | Callable[[Fault], str]
    what_to_do: str
    latches_idle: bool  # it also has to be cleared if it occurred while torque was off

    def __new__(
        cls,
        name: str,
        part: str,
        reaction: Reaction,
        blocks: Blocks,
        clears: Clears,
        bound_ticks: int,
        meaning: str,
        template: str | Callable[[Fault], str],
        what_to_do: str,
        latches_idle: bool = False,
    ) -> FaultKind:
        kind = str.__new__(cls, name)
        kind._value_ = name
        kind.part, kind.reaction, kind.blocks, kind.clears = part, reaction, blocks, clears
        kind.meaning, kind.template, kind.what_to_do = meaning, template, what_to_do
        kind.bound_ticks, kind.latches_idle = bound_ticks, latches_idle
        return kind

    # fmt: off
    # signals of a drive
    DRIVE_LATE = (
        "drive_late", "drive", WARN, NO, WHEN_GONE, 4,
        "Position or current is older than two ticks.", _late, WIRING,
    )
    DRIVE_QUIET = (
        "drive_quiet", "drive", DAMPING, ALWAYS, WHEN_GONE, 5,
        "Neither position nor current came for three ticks.", _silence("message"), WIRING,
    )
    DRIVE_SILENT = (
        "drive_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 12,
        "Neither position nor current came for ten ticks.", _silence("message"), WIRING + THEN_CLEAR,
    )
    POSITION_STALE = (
        "position_stale", "drive", DAMPING, ALWAYS, WHEN_GONE, 5,
        "No position came for three ticks.", _silence("position"), WIRING,
    )
    POSITION_SILENT = (
        "position_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 12,
        "No position came for ten ticks.", _silence("position"), WIRING + THEN_CLEAR,
    )
    CURRENT_STALE = (
        "current_stale", "drive", HOLD, ALWAYS, WHEN_GONE, 5,
        "No current came for three ticks.", _silence("current"), WIRING,
    )
    CURRENT_SILENT = (
        "current_silent", "drive", SOFT_STOP, ALWAYS, BY_HAND, 12,
        "No current came for ten ticks.", _silence("current"), WIRING + THEN_CLEAR,
    )
    HEARTBEAT_SILENT = (
        "heartbeat_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 192,
        "No heartbeat came for 0.5 s.", _silence("heartbeat"), WIRING + THEN_CLEAR,
    )
    TEMPERATURE_SILENT = (
        "temperature_silent", "drive", SOFT_STOP, ALWAYS, WHEN_GONE, 382,
        "No temperature came for 1 s.", _silence("temperature"), WIRING,
    )
    VOLTAGE_SILENT = (
        "voltage_silent", "drive", WARN, UNLESS_FORCED, WHEN_GONE, 382,
        "No bus voltage came for 1 s.", _silence("bus voltage"), WIRING,
    )
    # what a drive reports of itself
    DRIVE_ERROR = (
        "drive_error", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 41,
        "A drive reports an error.", "The {subject} drive reports error {flags}.", FIX,
    )
    DRIVE_DISARMED = (
        "drive_disarmed", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 41,
        "A drive left closed loop by itself.", "The {subject} drive left closed loop by itself.", FIX,
    )
    DRIVE_ENERGISED = (
        "drive_energised", "drive", WARN, ALWAYS, WHEN_GONE, 117,
        "A drive is energised although the robot is not armed.",
        "The {subject} drive is {activity} although the robot is not armed.",
        "end other programs that command it, or 'mudskipper disarm'",
    )
    DRIVE_RESTARTED = (
        "drive_restarted", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 580,
        "A drive restarted.", "The {subject} drive restarted.",
        "check its supply and its joint's angle, then 'mudskipper clear'", True,  # also while torque is off
    )
    DRIVE_VERSION = (
        "drive_version", "drive", NONE, ALWAYS, WHEN_GONE, 2,
        "A drive's firmware is unknown or not supported.",
        "The {subject} drive's firmware is {version}; {supported} is supported.",
        "correct its type or model in [drive.JOINT], or install a supported firmware",
    )
    DUPLICATE_NODE_ID = (
        "duplicate_node_id", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 500,
        "Two drives on a bus send under one node id.", "Two drives send under the node id of the {subject} drive.",
        "give every drive on a bus a node id of its own, one at a time" + THEN_CLEAR,
    )
    WRONG_DRIVE = (
        "wrong_drive", "drive", NONE, ALWAYS, WHEN_GONE, 2,
        "A drive has another serial number than configured.",
        "The {subject} drive's serial number is {serial}, not {expected}.",
        "connect the right drive, or calibrate this one and write its serial_number into [drive.JOINT]",
    )
    DRIVE_SETTINGS = (
        "drive_settings", "drive", NONE, ALWAYS, WHEN_GONE, 800,
        "A drive's settings differ from the configuration.", "The settings of the {subject} drive do not fit.", SET_UP,
    )
    FOREIGN_COMMANDS = (
        "foreign_commands", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 2,
        "Another program commands a drive.", "Another program sent {commands} commands to {subject}.", OTHERS,
    )
    SETPOINT_MISMATCH = (
        "setpoint_mismatch", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 120,
        "A drive follows other torques than commanded.", "{subject} follows other torques than commanded.", OTHERS,
    )
    WATCHDOG_UNKNOWN = (
        "watchdog_unknown", "watchdog", NONE, UNLESS_FORCED, WHEN_GONE, 2,
        "A drive's watchdog is unknown.", "The {subject} drive's watchdog is unknown.",
        f"{SET_UP}, or arm with --force watchdog_unknown",
    )
    WATCHDOG_OFF = (
        "watchdog_off", "watchdog", NONE, ALWAYS, WHEN_GONE, 2,
        "A drive's watchdog is off or too slow.",
        "The {subject} drive's watchdog is {setting}; it must trip within {longest_s:g} s.",
        f"set the drive's watchdog to 0.1 s, and save; {SET_UP}",
    )
    UNCALIBRATED = (
        "uncalibrated", "calibration", NONE, UNLESS_FORCED, WHEN_GONE, 2,
        "The sign and torque constant of a joint are not calibrated for its drive.",
        "Signs and torque constants are not calibrated for the drives of {joints}: run 'mudskipper calibrate', or go"
        " without by 'mudskipper arm --force uncalibrated'.",
        "calibrate the robot; see docs/how-to/calibrate.md",
    )
    ARMING_FAILED = (
        "arming_failed", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 765,
        "A drive did not go into closed loop.", "{subject} did not go into closed loop within {longest_s:g} s.", FIX,
    )
    # the power of the motors
    POWER_CUT = (
        "power_cut", "power", DRIVES_IDLE, ALWAYS, BY_HAND, 45,
        "The motors' power was cut, as by the emergency stop.", "The motors' power was cut",
        "release the emergency stop once it is safe, or look at supply and bus cable; then 'mudskipper clear', and"
        " 'mudskipper arm'", True,
    )
    # buses
    BUS_WARNING = (
        "bus_warning", "bus", WARN, NO, WHEN_GONE, 2,
        "A bus controller counts many errors.", "The {subject} bus has many errors.", WIRES,
    )
    BUS_PASSIVE = (
        "bus_passive", "bus", WARN, ALWAYS, WHEN_GONE, 2,
        "A bus controller is error-passive.", "The {subject} bus has so many errors that it is error-passive.", WIRES,
    )
    BUS_OFF = (
        "bus_off", "bus", DAMPING, ALWAYS, BY_HAND, 2,
        "A bus controller has left the bus.", "The {subject} bus is off.", WIRES + THEN_CLEAR,
    )
    BUS_REFUSES = (
        "bus_refuses", "bus", DAMPING, ALWAYS, WHEN_GONE, 5,
        "Commands were lost in three ticks in a row.", "The {subject} bus lost commands in {ticks} ticks in a row.",
        WIRES,
    )
    FRAMES_LOST = (
        "frames_lost", "bus", WARN, NO, WHEN_GONE, 2,
        "Frames came faster than they were read.",
        "{frames} frames of the {subject} bus were lost: they came faster than they were read.", BUSY,
    )
    # joints and motors
    JOINT_POSITION = (
        "joint_position", "joint", DAMPING, ALWAYS, BY_HAND, 3,
        "A joint is outside of its range and its margin, or of its range for 0.3 s at 30 % of its torque or more.",
        "The {subject} joint is at {angle_deg:.1f} degrees, outside of {low_deg:.0f} to {high_deg:.0f}.",
        "move it back by hand, then 'mudskipper clear'",
    )
    JOINT_VELOCITY = (
        "joint_velocity", "joint", DAMPING, ALWAYS, BY_HAND, 5,
        "A joint is faster than its limit allows.",
        "The {subject} joint turns at {velocity_rad_s:.0f} rad/s; the limit is {limit_rad_s:.0f} rad/s.", FIX,
    )
    JOINT_MOVING = (
        "joint_moving", "joint", NONE, ALWAYS, WHEN_GONE, 40,
        "A joint moves while torque is off.", "The {subject} joint moves while torque is off.",
        "hold it still: 'mudskipper arm --wait' arms once it is at rest",
    )
    JOINT_CURRENT = (
        "joint_current", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 6,
        "A motor takes more current than its limit.",
        "The {subject} motor takes {current_a:.1f} A; the limit is {limit_a:.1f} A.",
        "check current limits and torque constant, then 'mudskipper clear'",
    )
    JOINT_NOT_FOLLOWING = (
        "joint_not_following", "joint", SOFT_STOP, ALWAYS, BY_HAND, 765,
        "A joint stands still at full torque for 2 s.",
        "The {subject} joint stands still at full torque for {stalled_s:.1f} s.",
        "free the joint, then 'mudskipper clear'; if firm mud holds it, walk less deep",
    )
    JOINT_RUNAWAY = (
        "joint_runaway", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 60,
        "A joint gains energy that its motor was not commanded to give.",
        "The {subject} joint gained {energy_j:.2f} J without a command; the limit is {limit_j:.2f} J.", DISOBEYS,
    )
    JOINT_DRIVEN_BACK = (
        "joint_driven_back", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 270,
        "A joint moves against a large torque for 0.3 s.",
        "The {subject} joint moves against its motor's torque, as under a load that the motor cannot hold, or at an end"
        " stop while its encoder slips.",
        "take a load off, or check encoder, magnet and cable, then 'mudskipper clear'",
    )
    JOINT_OSCILLATING = (
        "joint_oscillating", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 120,
        "A joint keeps moving away from its commanded path, or shakes about it.",
        "The {subject} joint swings about its commanded path: by {away_rad:.2f} rad away from it in all within 0.3 s.",
        f"lower the stiffness in [gains], or {DISOBEYS}",
    )
    FOLLOWING_ERROR = (
        "following_error", "joint", DAMPING, ALWAYS, BY_HAND, 1900,
        "A joint in air does not follow its commanded path.",
        "The {subject} joint is {error_rad:.2f} rad off its commanded path in air; the limit is {limit_rad:.2f} rad.",
        "free the joint, check motor and encoder, then 'mudskipper clear'",
    )
    DAMPING_FAILED = (
        "damping_failed", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 45,
        "A motor's current does not fit its damping torque for 0.1 s.",
        "The {subject} motor gives {measured_nm:.2f} N·m instead of the damping torque of {commanded_nm:.2f} N·m.",
        DISOBEYS,
    )
    ENCODER_JUMP = (
        "encoder_jump", "joint", DAMPING, ALWAYS, BY_HAND, 3,
        "A position jumped farther than a joint can move.",
        "The {subject} encoder jumped by {step_deg:.0f} degrees in {gap_ms:.1f} ms.", ENCODER,
    )
    ENCODER_STUCK = (
        "encoder_stuck", "joint", DAMPING, ALWAYS, BY_HAND, 120,
        "A position stands still while joint or torque change.",
        "The {subject} encoder stands still while the joint moves or its torque changes.", ENCODER,
    )
    ENCODER_SLIPS = (
        "encoder_slips", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 1500,
        "A position drifts away from the integral of its speed.",
        "The {subject} angle drifted by {slipped_rad:+.2f} rad that its speed does not explain.",
        "check magnet, belt and range of velocity, calibrate the zero, then 'mudskipper clear'",
    )
    SPEED_WRONG = (
        "speed_wrong", "joint", SOFT_STOP, ALWAYS, BY_HAND, 1900,
        "A reported speed is not the rate of change of its position.",
        "The {subject} drive's speed is {factor:.2f} times the rate of change of its angle.",
        "check the drive's model and range of velocity in [drive.JOINT], then 'mudskipper clear'",
    )
    TORQUE_MISSING = (
        "torque_missing", "joint", SOFT_STOP, ALWAYS, BY_HAND, 45,
        "A motor's current does not fit its torque command for 0.1 s.",
        "The {subject} motor gives {measured_nm:.2f} N·m instead of {commanded_nm:.2f} N·m.",
        "check the drive's limits, its torque constant and cables, then 'mudskipper clear'",
    )
    ZERO_SHIFTED = (
        "zero_shifted", "joint", NONE, ALWAYS, WHEN_GONE, 580,
        "A drive reports another angle after a restart or a silence, so its zero may have shifted.",
        "The {subject} joint was at {before_deg:.1f} and is reported at {now_deg:.1f} degrees, and its drive saw no"
        " motion between.",
        "if 'mudskipper status' shows the joint's true angle, 'mudskipper clear --zero'; else correct its zero_turn and"
        " restart the daemon",
    )
    TORQUE_GAIN = (
        "torque_gain", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 1400,
        "A motor gives another torque than commanded, by the acceleration of its joint in air.",
        "The {subject} motor gives {gain:.2g} times the commanded torque; 1/{most:g} to {most:g} times is permitted.",
        "run 'mudskipper experiment actuator'; check the drive's torque constant and the inertias in [arm];"
        " then 'mudskipper clear'",
    )
    MOTOR_OVERHEATING = (
        "motor_overheating", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 100,
        "A motor is nearly too hot.", "The {subject} motor has {temperature_c:.0f} degrees C.", COOL,
    )
    MOTOR_HOT = (
        "motor_hot", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 100,
        "A motor is too hot.", "The {subject} motor has {temperature_c:.0f} degrees C.", COOL_AND_CLEAR,
    )
    WINDING_OVERHEATING = (
        "winding_overheating", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 11,
        "A winding is nearly too hot, estimated from its currents.",
        "The {subject} motor's winding has {temperature_c:.0f} degrees C, estimated from its currents.", COOL,
    )
    WINDING_HOT = (
        "winding_hot", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 11,
        "A winding is too hot, estimated from its currents.",
        "The {subject} motor's winding has {temperature_c:.0f} degrees C, estimated from its currents.", COOL_AND_CLEAR,
    )
    VOLTAGE_LOW = (
        "voltage_low", "joint", WARN, NO, WHEN_GONE, 100,
        "The supply voltage is low.", "The {subject} drive has only {voltage_v:.1f} V.", "charge or change the battery",
    )
    VOLTAGE_UNDER = (
        "voltage_under", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 100,
        "The supply voltage is too low.", "The {subject} drive has {voltage_v:.1f} V; the minimum is {least_v:g} V.",
        "charge or change the battery",
    )
    FLIPPER_STUCK = (
        "flipper_stuck", "flipper", DAMPING, ALWAYS, BY_HAND, 2,
        "A flipper is still stuck in the mud after every attempt to free it.", _stuck,
        "free it by hand, then 'mudskipper clear', and walk less deep",
    )
    # the loop itself
    TORQUE_NOT_FINITE = (
        "torque_not_finite", "loop", DRIVES_IDLE, ALWAYS, BY_RESTART, 2,
        "A torque was not a finite number.", SAME, REPORT,
    )
    COMMAND_REFUSED = (
        "command_refused", "loop", DRIVES_IDLE, ALWAYS, BY_RESTART, 2,
        "The transmit gate refused a command.", SAME, REPORT,
    )
    LOOP_OVERRUN = (
        "loop_overrun", "loop", WARN, NO, WHEN_GONE, 1,
        "The loop missed a tick.", "The loop missed {missed} of its ticks.", BUSY,
    )
    LOOP_LAGGING = (
        "loop_lagging", "loop", SOFT_STOP, ALWAYS, WHEN_GONE, 101,
        "The loop missed five ticks in a row, or a tenth of a hundred.", "The loop lags: {extent}.", BUSY,
    )
    LOOP_CRAWLING = (
        "loop_crawling", "loop", DRIVES_IDLE, ALWAYS, BY_HAND, 25,
        "Commands are sent too rarely to brake a joint.", "The loop's ticks take {tick_ms:.0f} ms.", BUSY + THEN_CLEAR,
    )
    LOOP_STALLED = (
        "loop_stalled", "loop", DAMPING, ALWAYS, WHEN_GONE, 2,
        "The loop stood still.", "The loop stood still for {late_ms:.0f} ms.", BUSY,
    )
    CLOCK_STEP = (
        "clock_step", "clock", WARN, NO, WHEN_GONE, 2,
        "The computer's wall clock was set.", "The computer's wall clock was set by {step_s:+.1f} s.",
        "do nothing: control uses another clock; dates in the log may jump",
    )
    # a stride closes in 25 to 40 units, one a tick
    ESTIMATE_WILD = (
        "estimate_wild", "estimator", WARN, NO, WHEN_GONE, 60,
        "An estimated coefficient is beyond what any mud has.",
        "Stride {stride} of the {subject} flipper gave a coefficient beyond what any mud has.",
        "look at the strides in the log; the estimate of the mud leaves it out",
    )
    POSE_LOST = (
        "pose_lost", "pose", WARN, NO, WHEN_GONE, 22,
        "The body's position is no longer reported.", SAME, "check the motion capture and its bridge",
    )
    LEASE_LOST = (
        "lease_lost", "lease", SOFT_STOP, ALWAYS, WHEN_GONE, 2,
        "The program that held the lease disconnected or did not renew it.",
        "{holder} held the lease, and disconnected or did not renew it.", "make the robot safe, then arm again",
    )
    # the log
    DISK_LOW = (
        "disk_low", "log", WARN, UNLESS_FORCED, WHEN_GONE, 400,
        "The log's disk is nearly full.", "The log's disk has {free_percent:.1f} % free ({free_mb:.0f} MB).",
        "free space on the log's disk, or lower log.quota_bytes",
    )
    LOG_UNWRITABLE = (
        "log_unwritable", "log", WARN, UNLESS_FORCED, WHEN_GONE, 400,
        "The log cannot be written.", SAME,
        "fix what the message names: the log's folder, its permissions, or its disk",
    )
    DISK_SLOW = (
        "disk_slow", "log", WARN, NO, WHEN_GONE, 400,
        "The log's disk is slow.", "One write to the log's disk took {write_s:.1f} s.", "use another card or disk",
    )
    RECORDER_DEAD = (
        "recorder_dead", "log", WARN, UNLESS_FORCED, WHEN_GONE, 2,
        "The log's writer has died: nothing is recorded.", SAME, "restart the daemon",
    )
    ROWS_LOST = (
        "rows_lost", "log", WARN, NO, WHEN_GONE, 2,
        "The log lost rows.", "The log has lost {rows} rows so far.", "use another card or disk",
    )
    # fmt: on

    def fault(self, subject: str = "", **values: float | str) -> Fault:
        """Return a fault of this kind; `values` are the measured values that its message shows, in its units."""
        return Fault(self, subject, tuple(values.items()))


class Fault(NamedTuple):
    """One present fault."""

    kind: FaultKind
    subject: str = ""  # the joint, the bus, the flipper, or nothing
    values: tuple[tuple[str, float | str], ...] = ()

    @property
    def name(self) -> str:
        return self.kind.value

    @property
    def check_line(self) -> str:
        """Return the line of `mudskipper check` that shows this fault."""
        return f"{self.kind.part}.{self.subject}" if self.subject else self.kind.part

    def with_values(self, **values: float | str) -> Fault:
        """Return the same fault with more values for its message."""
        return self._replace(values=(*self.values, *values.items()))

    @property
    def message(self) -> str:
        """Return what happened, in whole sentences.

        A fault without the values that its message shows is described in general: no text may stop the loop.
        """
        try:
            return self.exact_message()
        except (KeyError, ValueError):
            return f"{self.kind.meaning} ({self.subject})" if self.subject else self.kind.meaning

    def exact_message(self) -> str:
        """Return the message with its values, and with the `reason` that some carry, such as a drive's own text.

        Raises KeyError or ValueError if a value is missing or is no number.
        """
        template, values = self.kind.template or self.kind.meaning, dict(self.values)
        message = template.format(subject=self.subject, **values) if isinstance(template, str) else template(self)
        reason = str(values.get("reason", "")).rstrip(".")
        return f"{message.rstrip('.')}: {reason}." if reason else message

    @property
    def advice(self) -> str:
        """Return what happened, and what to do."""
        to_do = self.kind.what_to_do
        return f"{self.message} {to_do[:1].upper()}{to_do[1:]}."


FAULT_KINDS: dict[str, FaultKind] = {kind.value: kind for kind in FaultKind}


OVERRULED_BY_FORCE = tuple(kind.value for kind in FaultKind if kind.blocks is Blocks.UNLESS_FORCED)
