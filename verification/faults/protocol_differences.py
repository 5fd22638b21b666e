"""Lists the failures that a protocol shows otherwise than an ODrive's, or not at all, each with the reason.

A difference changes fields of the failure mode for one type of drive: the fault that may be reported in its place, what
is true as well, how it is caused. Where the protocol cannot show a failure, it is waived: it is injected all the same,
and the bounds on energy, torque and arming hold, but no fault is demanded. What does not exist is left out. The report
names every difference.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from control.faults import FaultKind
from drivers.drive_types import DRIVE_TYPES
from drivers.fault_injection.failure_table import ABSENT_DRIVE, BY_NAME, FailureMode

SHOWN = {"fault": "shown as", "instead": "instead", "also": "also", "pushes_until": "pushes until"}  # changed fields


class Difference(NamedTuple):
    """`changes` are fields of the failure mode; None: it does not exist with this protocol."""

    why: str
    changes: Mapping[str, Any] | None = None

    @property
    def exists(self) -> bool:
        return self.changes is not None

    @property
    def text(self) -> str:
        if self.changes is None:
            return f"does not exist: {self.why}"
        if "waived" in self.changes:
            return f"any reaction, or none: {self.why}"
        named = [f"{word} {_listed(self.changes[key])}" for key, word in SHOWN.items() if key in self.changes]
        return f"{' and '.join(named) or 'otherwise caused'}: {self.why}"


def _listed(names: str | tuple[str, ...]) -> str:
    return names if isinstance(names, str) else ", ".join(names)


def _instead(why: str, *faults: str) -> Difference:
    return Difference(why, {"instead": faults})


def _also(why: str, *faults: str) -> Difference:
    return Difference(why, {"also": faults})


def _waived(why: str) -> Difference:
    return Difference(why, {"waived": True})


Table = Mapping[str, Difference]

UNASKED = "a drive that is not asked does not answer"
ASKED: Table = {  # drives that answer only when asked
    "drive_late": Difference(
        "a command that is lost is a question that is lost, for a tick longer: only answers are lost",
        {"act": ("unheard",), "loses_commands": False},
    ),
    "bus_refuses": _also(UNASKED, *ABSENT_DRIVE, "drive_quiet"),
}

ONE_ANSWER = "one answer has all signals, so none of them is missing alone"
NO_CLAMP = Difference(
    "the drive limits no torque at a speed, which its set-point would show, and at a torque that stays at its limit a"
    " frozen encoder looks like a joint that mud holds",
    {"pushes_until": FaultKind.JOINT_NOT_FOLLOWING.value},
)
LEFT_AT_ONCE = _instead("an answer states that it was in the mode, and has left it", "drive_disarmed")
HELD_FAST = "a joint that is held fast reports the same codes in every answer, as an encoder does that has failed"
MIT: Table = {
    "position_stale": _instead(ONE_ANSWER, "drive_quiet"),
    "position_silent": _instead(ONE_ANSWER, "drive_silent"),
    "current_stale": _instead(ONE_ANSWER, "drive_quiet"),
    "current_silent": _instead(ONE_ANSWER, "drive_silent"),
    "heartbeat_silent": _instead(ONE_ANSWER, "drive_silent"),
    "encoder_stuck": _also(
        "one answer has all signals: torque and status are frozen together with the angle",
        *("drive_energised", "torque_missing", "damping_failed"),
    ),
    "encoder_stuck, at zero speed": NO_CLAMP,
    "daemon_hung": _also(UNASKED, "voltage_silent"),
    "drive_error, by its watchdog": Difference(
        "a drive without commands sends no answer that could state the error",
        {"instead": ("drive_silent",), "component": "JOINT.command", "kind": "off", "act": ()},
    ),
    "drive_error, by another program's stop": _instead(
        "the command to leave the mode is no error: the drive is without torque", "drive_disarmed"
    ),
    "drive_energised": _instead(
        "it is commanded to leave the mode in every tick, and the other program's command is seen", "foreign_commands"
    ),
    "drive_version": _also(
        "a drive without a version is starting, so none of its registers is known", "watchdog_unknown", "wrong_drive"
    ),
    "arming_failed": LEFT_AT_ONCE,
    "joint_not_following": _instead(HELD_FAST, "encoder_stuck"),
    "following_error": _instead(HELD_FAST, "encoder_stuck"),
    **dict.fromkeys(
        ("encoder_slips, at +0.05 rad/s", "encoder_slips, at -0.05 rad/s"),
        _instead(
            "the loop holds the angle at one code while the joint creeps, as of an encoder that is stuck",
            "encoder_stuck",
        ),
    ),
}
NO_REGISTERS = "MIT mode reads no register of this motor"
NO_VOLTAGE = "no answer states the supply's voltage; below a limit of its own the drive reports an error"
NO_STATUS = "no answer states whether the drive is in the mode"
WITHOUT_REGISTERS: Table = {  # CubeMars
    "drive_version": Difference(NO_REGISTERS),
    "wrong_drive": Difference(NO_REGISTERS),
    "drive_settings": Difference(NO_REGISTERS),
    "watchdog_unknown": Difference(NO_REGISTERS),
    "watchdog_off": Difference(NO_REGISTERS),
    "drive_disarmed": _waived(NO_STATUS),
    "arming_failed": _waived(NO_STATUS),
    "voltage_silent": _waived(NO_VOLTAGE),
    "voltage_low": _waived(NO_VOLTAGE),
    "voltage_under": _waived(NO_VOLTAGE),
}
FOREIGN_TORQUES = ("foreign_commands", "setpoint_mismatch", "foreign_torque")
RESTARTED = Difference(
    "each command of another program starts the drive again: it is stopped in every tick until that program ends",
    {"restarted": True},
)
MOTEUS: Table = {
    "drive_error, by its watchdog": Difference(
        "a drive without commands is not asked either, so its watchdog trips while it is",
        {"act": ("tripped", "WATCHDOG")},
    ),
    "drive_error, by another program's stop": _instead("a stop is no error", "drive_disarmed"),
    "encoder_stuck, at zero speed": NO_CLAMP,
    "arming_failed": LEFT_AT_ONCE,
    "watchdog_unknown": _instead(
        "no answer says that a drive is starting: one without the version of its registers is of unknown firmware",
        "drive_version",
    ),
    "watchdog_off": Difference(
        "another program's command switches it off, which is seen at once; the setting is read back while idle",
        {"fault": FaultKind.FOREIGN_COMMANDS.value, "also": (FaultKind.WATCHDOG_OFF.value,)},
    ),
    **dict.fromkeys(
        (mode.name for mode in BY_NAME.values() if mode.fault in FOREIGN_TORQUES),
        RESTARTED,
    ),
}
ODRIVE: Table = {"drive_settings": Difference("no setting but the watchdog is read back")}
ZERO = "an idle drive that reports exactly zero is asked for its counts"
NO_TEMPERATURE = "its messages have no temperature: the winding's is computed from the current"
COUNTED = "before its first closed loop its position is asked for, and not while its watchdog is tried"
UNKNOWN_POSITION = ("drive_late", "position_stale", "position_silent")
LOST_COUNTS = _also(COUNTED, *UNKNOWN_POSITION)
ODRIVE05: Table = {
    **dict.fromkeys(("drive_silent", "drive_restarted", "watchdog_unknown", "zero_shifted"), LOST_COUNTS),
    **dict.fromkeys(("bus_off", "bus_refuses", "daemon_hung", "power_cut"), LOST_COUNTS),
    "power_cut, the drives restart": _also(
        f"{COUNTED}; an idle one has no current", *UNKNOWN_POSITION, "current_silent"
    ),
    "drive_error, by its watchdog": _also(
        f"{ZERO}, and no question reaches it", "drive_late", "position_stale", "position_silent"
    ),
    "loop_lagging, every tick too long": _also(f"{ZERO}, and the answers are as late as the loop", "drive_late"),
    "duplicate_node_id": _also("the counts of one drive are compared with the position of the other", "drive_settings"),
    "drive_energised": _instead(
        "a watchdog that has expired keeps an idle drive from closed loop, and the command is seen", "foreign_commands"
    ),
    "joint_position": _also("the velocity before the first closed loop is that of two positions", "joint_velocity"),
    "drive_settings": Difference("no setting is read back"),
    "wrong_drive": Difference("no message has its serial number"),
    "watchdog_off": Difference("its watchdog is proven once after each start, and not read back"),
    "temperature_silent": Difference(NO_TEMPERATURE),
    "motor_overheating": _waived(NO_TEMPERATURE),
    "motor_hot": _waived(NO_TEMPERATURE),
}
BY_TYPE: dict[str, Table] = {"odrive": ODRIVE, "odrive05": ODRIVE05, "moteus": MOTEUS, "mit": MIT}


def differences(drive: str) -> Table:
    """Return the differences of a type of drive by the name of the failure mode; `drive` as in `with_drive_type`."""
    name, _, model = drive.partition(":")
    asked = ASKED if DRIVE_TYPES[name].query(1) is not None else {}
    given: dict[str, Any] = {"model": model} if model else {}
    unreadable = not DRIVE_TYPES[name].parameters(bus="", node_id=1, **given).reports_settings
    of_model = WITHOUT_REGISTERS if unreadable else {}
    return {**asked, **BY_TYPE.get(name, {}), **of_model}


def mode_of(name: str, drive: str) -> FailureMode:
    """Return a failure mode as it is with this type of drive."""
    difference = differences(drive).get(name)
    mode = BY_NAME[name]
    return replace(mode, why=difference.why, **(difference.changes or {})) if difference else mode
