"""The table of failures: what can fail, how, which fault the robot must report, and within which bounds.

A failure is one row, and each fault that it must lead to is one `expects`. Four users read the table: the daemon causes
the rows without a cause of their own as `mudskipper fail` asks; the fault matrix injects every row that expects
something, in each of its phases; the random schedules draw the rows that are `scheduled`; the tests of the loop choose
rows by their fault. A row with a cause needs the simulated robot: `drive` names parameters of a simulated drive and
their values while it lasts, `act` a function of verification/faults/ with its arguments. In components
JOINT stands for each joint and NAME for each bus. Components and kinds of `mudskipper fail` follow PX4's `failure`
command.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import chain
from math import nan
from typing import Any

from control.faults import FAULT_KINDS, FaultKind
from control.records import JOINTS


class FailureKind(StrEnum):
    """How a component of the daemon can fail."""

    OFF = "off"
    STUCK = "stuck"
    GARBAGE = "garbage"
    SLOW = "slow"
    INTERMITTENT = "intermittent"
    WARNING = "warning"
    PASSIVE = "passive"
    BUS_OFF = "bus-off"


GAIT = ("insertion", "stance", "extraction", "swing")
MOVING = ("hold", *GAIT, "stopping")
EVERYWHERE = ("idle", "arming", *MOVING)
PHASES = (*EVERYWHERE, "recovery")
TURNING_JOINT = {"insertion": "adduction", "stance": "sweep", "extraction": "adduction", "swing": "sweep"}
REPORTED_S = 0.0  # the failure lasts until its fault is reported


@dataclass(frozen=True, kw_only=True)
class FailureMode:
    """One failure and one fault that it must lead to.

    `fault` names a kind of fault, or a failure that has none, such as a dead daemon: then the motors only have to stay
    within the bounds on their energy. The last fields are those of a type of drive whose protocol shows the failure
    otherwise (verification/faults/protocol_differences.py).
    """

    component: str
    kind: str
    effect: str = ""  # for people
    drive: Mapping[str, Any] = field(default_factory=dict)  # changed parameters of the simulated drive
    act: tuple[Any, ...] = ()  # name of an injector, and its arguments
    scheduled: bool = False  # the random schedules draw it
    loses_commands: bool = False  # commands may not reach a drive: only its watchdog removes the torque
    loses_rows: bool = False  # of the log
    raises: bool = False  # an exception ends the daemon
    torque_nm: float = 0.0  # of another program's commands, above the torque limit

    fault: str = ""
    how: str = ""  # distinguishes the modes of one fault
    lasts_s: float = 0.5
    phases: tuple[str, ...] = EVERYWHERE
    bound_ticks: int | None = None  # where this mode is detected sooner than the kind's bound
    any_reaction: bool = False  # and none: only energy, torque and arming are bounded
    turns: bool = False  # only a joint that turns in the phase is chosen: it is detected at no other

    instead: tuple[str, ...] = ()  # faults that may be reported in its place
    also: tuple[str, ...] = ()  # faults that may be reported as well, because they are true too
    waived: bool = False  # the protocol cannot show it: no reaction is demanded
    pushes_until: str = ""  # the fault that ends a push against an end stop at the latest; empty: this one
    restarted: bool = False  # another program starts the drive again and again while it lasts
    why: str = ""  # the reason of what differs

    @property
    def name(self) -> str:
        return f"{self.fault}, {self.how}" if self.how else self.fault

    @property
    def fault_kind(self) -> FaultKind | None:
        return FAULT_KINDS.get(self.fault)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the faults as one of which it may be reported."""
        return self.fault, *self.instead

    @property
    def by_daemon(self) -> bool:
        """Return whether the daemon causes it itself, on any robot."""
        return not self.drive and not self.act

    @property
    def ends_loop(self) -> bool:
        """Return whether the loop of the daemon ends or hangs."""
        return self.fault in ("daemon_killed", "daemon_hung", "bug_in_the_tick")

    @property
    def demands_reaction(self) -> bool:
        """Return whether a fault must be reported."""
        return not (self.waived or self.any_reaction)

    def joints(self, phase: str) -> tuple[str, ...]:
        """Return the joints from which one is drawn."""
        turning = TURNING_JOINT.get(phase, "") if self.turns else ""
        return tuple(joint for joint in JOINTS if joint.endswith(turning))


def expects(fault: str, lasts_s: float = 0.5, phases: tuple[str, ...] = EVERYWHERE, **more: Any) -> dict[str, Any]:
    return {"fault": fault, "lasts_s": lasts_s, "phases": phases} | more


def _row(component: str, kind: str, *expected: dict[str, Any], **of_failure: Any) -> list[FailureMode]:
    """Return a mode for each expected fault; one that the matrix leaves out where none is expected."""
    return [
        FailureMode(component=component, kind=kind, **of_failure, **expectation)
        for expectation in expected or ({"phases": ()},)
    ]


def _by_daemon(
    component: str, kind: str, effect: str, *expected: dict[str, Any], **of_failure: Any
) -> list[FailureMode]:
    """Return the modes of a failure that the daemon causes; the effect is for people."""
    return _row(component, kind, *expected, effect=effect, **of_failure)


def _degraded(part: str, kind: str, effect: str, **of_failure: Any) -> list[FailureMode]:
    """Return the mode of a component that is slow, intermittent or full of garbage."""
    phases = EVERYWHERE if part in MOTION_PARTS else ("hold", "stance")
    expected = expects("degraded", 1.0, phases, how=f"{part} {kind}", any_reaction=True)
    return _by_daemon(part, kind, effect, expected, **of_failure)


MOTION_PARTS = ("JOINT", "JOINT.position", "JOINT.current", "JOINT.command", "bus.NAME")  # the path of the control


def _signal(
    part: str, name: str, off: tuple[dict[str, Any], ...], stuck: tuple[dict[str, Any], ...] = ()
) -> list[FailureMode]:
    """Return the failures of one of the signals that a drive sends."""
    return [
        *_by_daemon(part, "off", f"its {name} does not arrive", *off),
        *_by_daemon(part, "stuck", f"its {name} is frozen while messages keep arriving", *stuck),
        *_degraded(part, "garbage", f"its {name} is random, not a number, huge, or of a wrong length"),
        *_degraded(part, "slow", f"messages with its {name} arrive 5 to 20 ms late"),
        *_degraded(part, "intermittent", f"half of the messages of its {name} are lost, at random"),
    ]


def _wrong_motor(
    kind: str, factor: str, error_deg: float, *expected: dict[str, Any], scheduled: bool = False
) -> list[FailureMode]:
    """Return a motor whose commutation is wrong, by the factor of its torque."""
    bounded = expects("wrong_motor", 1.0, (*MOVING, "recovery"), how=f"torque x {factor}", any_reaction=True)
    drive = {"commutation_error_deg": error_deg}
    return _row("JOINT.motor", kind, *expected, bounded, drive=drive, scheduled=scheduled)


def _slipping(rate_rad_s: float, how: str) -> Iterator[list[FailureMode]]:
    """Yield an encoder that slips alone, and one that slips together with the reported speed."""
    drive = {"encoder_slip_rad_s": rate_rad_s}
    yield _row(
        "JOINT.encoder", f"slipping {how}", expects("encoder_slips", 4.0, ("hold", "swing"), how=how), drive=drive
    )
    yield _row("JOINT.encoder", f"slipping with its speed {how}", drive=drive | {"velocity_slip_rad_s": rate_rad_s})


FOREIGN_NM = 1.0  # as much as the current limit allows, and more than the torque limit
TOO_STIFF = {"sweep_stiffness_nm_rad": 200.0, "adduction_stiffness_nm_rad": 200.0}  # for the delay of the loop
NOT_NUMBERS = {"sweep_stiffness_nm_rad": nan, "adduction_damping_nm_s_rad": nan}
NO_SPACE = "Nothing can be written to the log: No space left on device."
SLIPS_RAD_S = (0.05, 0.1, 0.3, 0.5, 1.0)
WRONG_RANGES = (  # of the codes of a drive's velocity, in rad/s
    ("25.64 for 50", 50.0 / 25.64, "encoder_slips"),
    ("65 for 50", 50.0 / 65.0, "speed_wrong"),
    ("45 for 50", 50.0 / 45.0, "speed_wrong"),
)
BUGGY_METHODS = {  # of the loop, by the part of the tick in which the method is called
    "reading drives": "drives.read",
    "reading pose": "pose.read",
    "learning": "learning.update",
    "choosing depth": "learning.step",
    "watching faults": "fault_monitor.update",
    "control": "controller.step",
    "sending": "drives.send",
    "recording": "recorder.put",
}

# fmt: off
FAILURE_MODES = tuple(chain.from_iterable((
    _row("nothing", "off", expects("none", 1.0, PHASES), act=("nothing",)),

    # a drive
    _by_daemon("JOINT", "off", "no frame arrives from the drive and none reaches it, as if it were unplugged",
               expects("drive_late", REPORTED_S), expects("drive_quiet", REPORTED_S, PHASES),
               expects("drive_silent", 1.0, PHASES), loses_commands=True),
    _by_daemon("JOINT", "stuck", "all that it reports is frozen; commands reach it"),
    _degraded("JOINT", "garbage", "all that it reports is random, not a number, huge, or of a wrong length;"
              " commands reach it", loses_commands=True),
    _degraded("JOINT", "slow", "all messages from and to it are 5 to 20 ms late", loses_commands=True),
    _degraded("JOINT", "intermittent", "half of the messages from and to it are lost, at random",
              loses_commands=True),
    _row("JOINT", "overcurrent", expects("drive_error", phases=PHASES), act=("tripped", "OVERCURRENT"),
         scheduled=True),
    _row("JOINT", "disarmed", expects("drive_disarmed", phases=MOVING), act=("left_closed_loop",),
         scheduled=True),
    _row("JOINT", "never armed", expects("arming_failed", 3.0, ("arming",)), act=("never_in_closed_loop",)),
    _row("JOINT", "restarted", expects("drive_restarted", 2.0), act=("restart",), scheduled=True),
    _row("JOINT", "restarted with another zero", expects("zero_shifted", 2.0, ("idle",)),
         act=("restart_shifted", 0.5, 0.1)),
    *(_row("JOINT", f"restarted within {boot_s:g} s with another zero", act=("restart_shifted", -0.5, boot_s))
      for boot_s in (0.02, 0.25, 1.0)),
    _row("JOINT", "duplicate", expects("duplicate_node_id", 1.6), act=("duplicate", 0.3)),
    _row("JOINT", "repeated", drive={"repeated_fraction": 0.7}, scheduled=True),
    _row("JOINT", "late", drive={"message_delay_s": 0.01}, scheduled=True),

    # its signals
    _signal("JOINT.position", "position", (expects("position_stale", REPORTED_S), expects("position_silent", 1.0)),
            (expects("encoder_stuck", 1.0, GAIT, turns=True),
             expects("encoder_stuck", 1.0, PHASES, how="in any phase", any_reaction=True))),
    _signal("JOINT.current", "current",
            (expects("current_stale", REPORTED_S, PHASES), expects("current_silent", 1.0))),
    _signal("JOINT.heartbeat", "heartbeat", (expects("heartbeat_silent", 1.0),)),
    _signal("JOINT.temperature", "temperature", (expects("temperature_silent", 1.5),)),
    _signal("JOINT.voltage", "bus voltage", (expects("voltage_silent", 1.5),)),
    _by_daemon("JOINT.error", "off", "it reports that it left closed loop, without an error"),
    _by_daemon("JOINT.error", "stuck", "it reports an error, and that it left closed loop where it says so"),
    _degraded("JOINT.error", "garbage", "it reports random errors"),
    _degraded("JOINT.error", "intermittent",
              "half of the time it reports an error, and that it left closed loop where it says so"),
    _row("JOINT.current", "excessive", expects("joint_current"), act=("current_reported", 40.0)),
    _row("JOINT.current", "reversed", expects("torque_missing", phases=MOVING), act=("current_reversed",)),
    _row("JOINT.current", "reversed while damping", expects("damping_failed", 0.3, MOVING),
         act=("damped_against_command",)),
    _row("JOINT.current", "lagging", drive={"current_lag_s": 0.02}, scheduled=True),

    # commands to it
    _by_daemon("JOINT.command", "off", "no command reaches it"),
    _degraded("JOINT.command", "slow", "commands reach it 5 to 20 ms late", loses_commands=True),
    _degraded("JOINT.command", "intermittent", "half of the commands to it are lost, at random",
              loses_commands=True),
    _row("JOINT.command", "off until its watchdog expires", expects("drive_error", 0.5, MOVING, how="by its watchdog"),
         act=("watchdog_ran_out",), loses_commands=True),

    # another program that commands it
    _row("JOINT.master", "torque", expects("foreign_commands", 1.0), act=("commanded_by_another", 0.3, 2, True)),
    _row("JOINT.master", "unheard torque", expects("setpoint_mismatch", 1.0, MOVING, how="every tenth command"),
         act=("commanded_by_another", 1.0, 10, False)),
    _row("JOINT.master", "unheard torque backwards",
         expects("setpoint_mismatch", 1.0, MOVING, how="every second command"),
         act=("commanded_by_another", -0.4, 2, False)),
    *(_row("JOINT.master", how := f"after every {ordinal} command, {path}",
           expects("foreign_torque", 1.0, MOVING, how=how, any_reaction=True),
           act=("commanded_by_another", FOREIGN_NM, every, heard), scheduled=True, torque_nm=FOREIGN_NM)
      for every, ordinal in ((2, "second"), (10, "tenth"))
      for path, heard in (("on the bus", True), ("unheard", False))),
    _row("JOINT.master", "stop", expects("drive_error", 0.5, MOVING, how="by another program's stop"),
         act=("forged", "EMERGENCY_STOP"), scheduled=True),
    _row("JOINT.master", "arming", act=("forged", "CLOSE_LOOP"), scheduled=True),
    _row("JOINT.master", "arming always", expects("drive_energised", 1.0, ("idle",)), act=("other_master",)),
    _row("JOINT.master", "old firmware", expects("drive_version", phases=("idle", "stance")),
         act=("forged", "OLD_FIRMWARE")),
    _row("JOINT.master", "other drive", expects("wrong_drive", phases=("idle",)),
         act=("forged", "OTHER_DRIVE")),
    _row("JOINT.master", "other setting", expects("drive_settings", 2.5, ("idle",)),
         act=("forged", "OTHER_SETTING")),
    _row("JOINT.master", "starting", expects("watchdog_unknown", phases=("idle",)), act=("forged", "STARTING")),
    _row("JOINT.master", "watchdog off", expects("watchdog_off", phases=("idle", "stance")),
         act=("forged", "WATCHDOG_OFF")),

    # its motor and encoder
    _wrong_motor("inverted", "-1", 180.0, expects("joint_runaway", 1.0, GAIT, turns=True), scheduled=True),
    _wrong_motor("dead", "0", 90.0),
    _wrong_motor("feeble", "0.1", 84.3),
    _wrong_motor("weak", "0.5", 60.0, scheduled=True),
    _row("JOINT.motor", "strong", drive={"torque_constant_error": 0.4}, scheduled=True),
    _row("JOINT.motor", "torque constant x 0.25", expects("torque_gain", 4.0, ("swing",), turns=True),
         drive={"torque_constant_error": -0.75}),
    *(_row("JOINT.motor", f"torque constant x {gain:g}", drive={"torque_constant_error": round(gain - 1.0, 3)},
           torque_nm=max(gain, 1.0) * 0.75)  # limit and gate bound the command only
      for gain in (0.2, 0.5, 2.0, 2.5, 4.0, 5.0)),
    _row("JOINT.motor", "warm", expects("motor_overheating", phases=PHASES), drive={"temperature_c": 82.0},
         scheduled=True),
    _row("JOINT.motor", "hot", expects("motor_hot"), drive={"temperature_c": 95.0}, scheduled=True),
    _row("JOINT.winding", "warm", expects("winding_overheating"), act=("heated", 83.0)),
    _row("JOINT.winding", "hot", expects("winding_hot"), act=("heated", 93.0)),
    _row("JOINT.supply", "low", expects("voltage_low"), drive={"bus_voltage_v": 19.0}, scheduled=True),
    _row("JOINT.supply", "lower", expects("voltage_under"), drive={"bus_voltage_v": 17.0}, scheduled=True),
    _row("JOINT.encoder", "shifted", expects("encoder_jump", phases=PHASES), drive={"encoder_offset_rad": 0.6},
         scheduled=True),
    _row("JOINT.encoder", "frozen", expects("encoder_stuck", 1.0, PHASES, how="at zero speed", any_reaction=True),
         drive={"encoder_frozen": True}, scheduled=True),
    *(row for rate_rad_s in (sign * rate for rate in SLIPS_RAD_S for sign in (1.0, -1.0))
      for row in _slipping(rate_rad_s, f"at {rate_rad_s:+g} rad/s")),
    _row("JOINT.encoder", "slipping at a stop", expects("joint_driven_back", 1.0, ("hold",)),
         act=("slipped_to_stop", 0.3)),
    *(_row("JOINT.encoder", f"speed in {ranges} rad/s", expects(fault, 8.0, ("stance",), how=f"{ranges} rad/s"),
           drive={"velocity_error": factor - 1.0})
      for ranges, factor, fault in WRONG_RANGES),  # it begins in a stance: no line has a slope yet
    _row("JOINT.encoder", "noisy", drive={"encoder_noise_rad": 0.005, "velocity_noise_rad_s": 1.0}, scheduled=True),

    # the joint and the flipper
    _row("JOINT.arm", "pushed", act=("pushed", 0.3), scheduled=True),
    _row("JOINT.arm", "out of range", expects("joint_position"), act=("out_of_range",)),
    _row("JOINT.arm", "fast", expects("joint_velocity", REPORTED_S), act=("moved_at_speed", 45.0)),
    _row("JOINT.arm", "moving", expects("joint_moving", REPORTED_S, ("idle",)), act=("moved_at_speed", 2.0)),
    _row("JOINT.arm", "blocked off its pose", expects("joint_not_following", 3.0, ("hold",)), act=("blocked",)),
    _row("JOINT.arm", "blocked", expects("following_error", 6.0, ("stance", "swing"), turns=True),
         act=("jammed",), scheduled=True),
    _row("JOINT.arm", "stiff", expects("joint_oscillating", 1.0, ("swing", "stopping")),
         act=("gains_changed", TOO_STIFF)),
    _row("flipper", "stuck", expects("flipper_stuck", phases=("recovery",)), act=("recovery_given_up",)),

    # the power of the motors
    _by_daemon("supply", "off", "no frame arrives from any drive, as if the emergency stop cut their power; commands"
               " reach them", expects("power_cut", 1.0, PHASES)),
    _row("supply", "cut", expects("power_cut", 1.0, PHASES, how="the drives restart"), act=("supply_cut",),
         loses_commands=True),

    # buses
    _by_daemon("bus.NAME", "off", "the interface is gone: no frame arrives, sending fails"),
    _by_daemon("bus.NAME", "stuck", "the transmit queue is full: sending fails", expects("bus_refuses"),
               loses_commands=True),
    _degraded("bus.NAME", "garbage", "half of the frames are malformed, with random frames in between",
              loses_commands=True),
    _degraded("bus.NAME", "slow", "all frames are 5 to 20 ms late", loses_commands=True),
    _degraded("bus.NAME", "intermittent", "half of the frames are lost, at random", loses_commands=True),
    _by_daemon("bus.NAME", "warning", "error frames arrive, and the controller warns", expects("bus_warning")),
    _by_daemon("bus.NAME", "passive", "error frames arrive, and the controller is error-passive",
               expects("bus_passive")),
    _by_daemon("bus.NAME", "bus-off", "the controller took itself off the bus: only error frames arrive, sending fails",
               expects("bus_off", 1.0, PHASES), loses_commands=True),
    _row("bus.NAME", "full", expects("frames_lost"), act=("port_lost_frames",)),

    # pose, log, loop and clock
    _by_daemon("pose", "off", "no pose arrives", expects("pose_lost")),
    _by_daemon("pose", "stuck", "the body seems to stand still"),
    _degraded("pose", "garbage", "the position is random, not a number or huge"),
    _degraded("pose", "slow", "the position is that of 0.2 s ago"),
    _degraded("pose", "intermittent", "half of the time no pose arrives, at random"),
    _by_daemon("log", "off", "the log's writer looks dead and takes no row"),
    _by_daemon("log", "stuck", "the log takes no row"),
    _degraded("log", "intermittent", "half of the rows are refused, at random", loses_rows=True),
    _row("log", "nearly full", expects("disk_low"), act=("writer_reports", {"free_fraction": 0.02})),
    _row("log", "full", expects("log_unwritable"), act=("writer_reports", {"problem": NO_SPACE})),
    _row("log", "slow", expects("disk_slow"), act=("writer_reports", {"slowest_write_s": 5.0})),
    _row("log", "dead", expects("recorder_dead"), act=("writer_reports", {"alive": False})),
    _row("log", "lossy", expects("rows_lost"), act=("writer_lost_rows",)),
    _by_daemon("loop", "stuck", "the loop stalls for 30 ms, once", expects("loop_stalled", phases=PHASES)),
    _by_daemon("loop", "slow", "every tick takes 4 ms longer",
               expects("loop_lagging", 1.0, ("hold", "stance"), how="every tick too long")),
    _row("loop", "late", expects("loop_overrun"), act=("loop_stalled", 1), scheduled=True),
    _row("loop", "lagging", expects("loop_lagging", bound_ticks=2), act=("loop_stalled", 7), scheduled=True),
    _row("loop", "crawling", expects("loop_crawling", phases=PHASES), act=("loop_stalled", 20)),
    _by_daemon("clock", "stuck", "the wall clock stops"),
    _by_daemon("clock", "garbage", "the wall clock is an hour ahead, and steps back at the end", expects("clock_step")),
    *(_row("clock", f"stepped {step_s:g} s", expects("none", 0.3, ("hold", *GAIT), how=f"wall clock {step_s:+g} s"),
           act=("wall_clock_stepped", step_s))
      for step_s in (0.01, 0.1, 2.0)),  # of the clock that stamps the frames

    # the daemon
    _row("loop", "torque not a number", expects("torque_not_finite", phases=MOVING),
         act=("gains_changed", NOT_NUMBERS)),
    _row("loop", "torque too large", expects("command_refused", phases=PHASES), act=("sent_torque", 5.0)),
    _row("loop", "wild estimate", expects("estimate_wild", phases=GAIT), act=("absurd_stride",)),
    _row("lease", "lost", expects("lease_lost", phases=PHASES), act=("lease_hung_up",)),
    _row("daemon", "killed", expects("daemon_killed", 1.0, PHASES), act=("killed",)),
    _row("daemon", "hung", expects("daemon_hung", 2.2, PHASES), act=("loop_stalled", 760)),
    *(_row("daemon", f"bug while {part}",
           expects("bug_in_the_tick", 0.5, ("hold", *GAIT, "recovery"), how=f"while {part}"),
           act=("bug_in", path), raises=True)
      for part, path in BUGGY_METHODS.items()),
)))
# fmt: on
BY_NAME = {mode.name: mode for mode in FAILURE_MODES if mode.fault}
SCHEDULED = {(mode.component, mode.kind): mode for mode in FAILURE_MODES if mode.scheduled}


def _effects() -> dict[str, dict[FailureKind, str]]:
    found: dict[str, dict[FailureKind, str]] = {}
    for mode in FAILURE_MODES:
        if mode.by_daemon:
            found.setdefault(mode.component, {})[FailureKind(mode.kind)] = mode.effect
    return found


EFFECTS: Mapping[str, Mapping[FailureKind, str]] = _effects()  # of the failures that the daemon causes

ABSENT_DRIVE = (  # faults of a drive from which no messages arrive
    "drive_late", "current_stale", "position_stale", "drive_quiet", "drive_silent", "heartbeat_silent",
    "temperature_silent", "voltage_silent", "drive_energised", "drive_error", "drive_restarted", "drive_version",
    "watchdog_unknown", "wrong_drive",
)  # fmt: skip
IDLE_DRIVE = ("drive_error", "drive_disarmed", "torque_missing")  # faults of a drive that no commands reach
CONSEQUENCES: Mapping[str, tuple[str, ...]] = {  # faults that may be reported with a fault, because they are true too
    "drive_quiet": ("drive_late", "position_stale", "current_stale"),
    "drive_silent": (*ABSENT_DRIVE, "zero_shifted"),  # of a joint that fell meanwhile
    "power_cut": (*ABSENT_DRIVE, "drive_quiet", "drive_disarmed", "torque_missing", "zero_shifted"),
    "position_stale": ("drive_late",),
    "position_silent": ("drive_late", "position_stale", "zero_shifted"),
    "current_stale": ("drive_late",),
    "current_silent": ("drive_late", "current_stale", "torque_missing"),
    "heartbeat_silent": ("drive_energised",),
    "drive_settings": ("foreign_commands",),  # by which another program changed them
    "drive_energised": ("foreign_commands",),  # by which another program closed the loop
    "drive_error": ("drive_disarmed", "torque_missing"),
    "drive_restarted": (*ABSENT_DRIVE, "zero_shifted"),
    "zero_shifted": (*ABSENT_DRIVE, "encoder_jump", "joint_moving"),  # by the restart
    # the second drive reports another angle, and its own set-points
    "duplicate_node_id": (
        *("encoder_jump", "joint_moving", "drive_disarmed", "joint_position", "encoder_stuck", "setpoint_mismatch"),
        *("encoder_slips", "speed_wrong", "zero_shifted"),
    ),
    "setpoint_mismatch": ("joint_runaway",),  # in that torque's direction
    "watchdog_unknown": ("drive_error", "drive_restarted", "drive_version", "wrong_drive"),
    "bus_off": (*ABSENT_DRIVE, "zero_shifted", *IDLE_DRIVE, "bus_refuses"),
    "bus_refuses": (*IDLE_DRIVE, "zero_shifted", "joint_runaway"),  # at the last torque
    "joint_position": ("encoder_jump", "zero_shifted"),
    "encoder_stuck": (
        "encoder_jump",
        "zero_shifted",
        "encoder_slips",
        "speed_wrong",
    ),  # when it reports angles again, or meanwhile
    "encoder_jump": ("joint_moving", "zero_shifted"),
    # it drifts on, and bends the line that shows a wrong speed
    "encoder_slips": ("joint_moving", "joint_position", "encoder_stuck", "speed_wrong"),
    "joint_driven_back": ("joint_moving", "joint_position", "encoder_jump", "zero_shifted"),
    "speed_wrong": ("encoder_stuck", "encoder_slips", "joint_moving", "joint_runaway", "joint_oscillating"),
    "joint_velocity": ("encoder_stuck", "joint_runaway"),  # its angle is held and its speed is not, nor commanded
    "joint_oscillating": ("joint_runaway",),
    "damping_failed": ("encoder_jump", "zero_shifted", "torque_missing", "joint_moving"),
    "motor_overheating": ("winding_overheating",),
    "motor_hot": ("winding_hot",),
    "loop_lagging": ("loop_overrun", "joint_oscillating"),  # the last torque takes a joint away from its target
    "loop_stalled": ("loop_lagging",),
    "loop_crawling": ("loop_stalled", "loop_lagging"),
    "daemon_hung": (*IDLE_DRIVE, "zero_shifted", "loop_stalled", "loop_crawling", "loop_lagging", "arming_failed"),
}
