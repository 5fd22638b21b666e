"""The table of failure modes: how each kind of fault is injected, and in which phases.

There is at least one mode for each kind in control/faults.py. Further modes are a daemon that dies, hangs, or meets a
bug in each stage of its tick, and no failure at all as the control group.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from control.faults import FAULT_KINDS, FaultKind
from control.records import JOINTS
from drivers.fault_injection.failures import EFFECTS, FailureKind
from simulation.devices.drive import Forgery
from verification.faults.injectors import (
    Injector,
    blocked,
    commanded_by_another,
    current_reported,
    current_reversed,
    damped_against_command,
    drive_with,
    duplicate,
    failing,
    forged,
    jammed,
    left_closed_loop,
    moved_at_speed,
    never_in_closed_loop,
    other_master,
    out_of_range,
    overcurrent,
    recovery_given_up,
    restart,
    stiff,
    watchdog_ran_out,
)
from verification.faults.loop_injectors import (
    absurd_stride,
    bug_in,
    five_newton_metres,
    gains_of_nan,
    heated,
    killed,
    lease_hung_up,
    loop_stalled,
    nothing,
    port_lost_frames,
    writer_lost_rows,
    writer_reports,
)
from verification.faults.phases import EVERYWHERE, GAIT, PHASES
from verification.faults.stepped_clock import wall_clock_stepped

NO_SPACE = "Nothing can be written to the log: No space left on device."
REPORTED_S = 0.0  # the failure lasts until its fault is reported
TURNING_JOINT = {"insertion": "adduction", "stance": "sweep", "extraction": "adduction", "swing": "sweep"}
MOVING = ("hold", *GAIT, "stopping")
DAEMON_FAULTS = ("daemon_killed", "daemon_hung", "bug_in_the_tick")


@dataclass(frozen=True)
class FailureMode:
    """One way to cause a fault. `fault` names a kind of fault, or another failure such as a dead daemon."""

    fault: str
    inject: Injector
    lasts_s: float = 0.5  # then the failure ends
    phases: tuple[str, ...] = EVERYWHERE
    how: str = ""  # distinguishes the modes of one fault
    no_commands: bool = False  # commands do not reach a drive: only its watchdog removes the torque
    ends_daemon: bool = False
    bound_ticks: int | None = None  # where this mode is detected sooner than the kind's bound
    turns: bool = False  # only a joint that turns in the phase is chosen: it is detected at no other
    demands_reaction: bool = True  # False: any reaction will do, as long as no motor puts in too much energy
    torque_nm: float = 0.0  # of another program's commands, above the torque limit
    loses_rows: bool = False  # of the log
    instead: tuple[str, ...] = ()  # faults that a protocol may report in its place
    restarted: bool = False  # another program starts the drive again and again while it lasts
    also: tuple[str, ...] = ()  # faults that may be reported as well, because with this protocol they are true too
    waived: bool = False  # the protocol cannot show it, so any reaction will do, and none
    pushes_until: str = ""  # the fault that ends a push against an end stop at the latest; empty: this one
    why: str = ""  # of what differs with this protocol

    @property
    def name(self) -> str:
        return f"{self.fault}, {self.how}" if self.how else self.fault

    def joints(self, phase: str) -> tuple[str, ...]:
        """Return the joints from which one is drawn."""
        turning = TURNING_JOINT.get(phase, "") if self.turns else ""
        return tuple(joint for joint in JOINTS if joint.endswith(turning))

    @property
    def ends_loop(self) -> bool:
        """Return whether the failure is one of the daemon's own, whose loop ends or hangs."""
        return self.fault in DAEMON_FAULTS

    @property
    def loses_commands(self) -> bool:
        """Return whether any command may be lost while the failure lasts, also one that idles a drive."""
        return self.no_commands and not self.demands_reaction

    @property
    def kind(self) -> FaultKind | None:
        return FAULT_KINDS.get(self.fault)

    @property
    def names(self) -> tuple[str, ...]:
        """The faults as one of which it may be reported."""
        return self.fault, *self.instead


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
BUG_PHASES = ("hold", *GAIT, "recovery")
DEGRADED = (FailureKind.SLOW, FailureKind.INTERMITTENT, FailureKind.GARBAGE)
COVERED = (("loop", FailureKind.SLOW), ("clock", FailureKind.GARBAGE))  # by modes of their own
MOTION_PARTS = ("JOINT", "JOINT.position", "JOINT.current", "JOINT.command", "bus.NAME")  # the path of the control
UNHEARD_PARTS = ("JOINT", "JOINT.command", "bus.NAME")  # through which commands pass
COMMUTATION_ERRORS_DEG = {"-1": 180.0, "0": 90.0, "0.1": 84.3, "0.5": 60.0}  # by the factor of the torque
CLOCK_STEPS_S = (0.01, 0.1, 2.0)  # small ones, of the clock that stamps the frames
FOREIGN_NM = 1.0  # as much as the current limit allows, and more than the torque limit


def _degraded_modes() -> Iterator[FailureMode]:
    """Yield a mode for each component that is slow, intermittent or full of garbage."""
    for part, kinds in EFFECTS.items():
        for kind in DEGRADED:
            if kind in kinds and (part, kind) not in COVERED:
                yield FailureMode(
                    "degraded",
                    failing(part.replace("NAME", "BUS"), kind),
                    1.0,
                    EVERYWHERE if part in MOTION_PARTS else ("hold", "stance"),
                    f"{part} {kind}",
                    no_commands=part in UNHEARD_PARTS,
                    loses_rows=part == "log",
                    demands_reaction=False,
                )


def _foreign_modes() -> Iterator[FailureMode]:
    for every, ordinal in ((2, "second"), (10, "tenth")):
        for path, heard in (("on the bus", True), ("unheard", False)):
            yield FailureMode(
                "foreign_torque",
                commanded_by_another(FOREIGN_NM, every, heard),
                1.0,
                MOVING,
                f"after every {ordinal} command, {path}",
                torque_nm=FOREIGN_NM,
                demands_reaction=False,
            )


FAILURE_MODES: tuple[FailureMode, ...] = (
    FailureMode("none", nothing, 1.0, PHASES),
    *(
        FailureMode("none", wall_clock_stepped(step_s), 0.3, ("hold", *GAIT), f"wall clock {step_s:+g} s")
        for step_s in CLOCK_STEPS_S
    ),
    # signals of a drive
    FailureMode("drive_late", failing("JOINT", "off"), REPORTED_S, no_commands=True),
    FailureMode("drive_quiet", failing("JOINT", "off"), REPORTED_S, PHASES, no_commands=True),
    FailureMode("drive_silent", failing("JOINT", "off"), 1.0, PHASES, no_commands=True),
    FailureMode("position_stale", failing("JOINT.position", "off"), REPORTED_S),
    FailureMode("position_silent", failing("JOINT.position", "off"), 1.0),
    FailureMode("current_stale", failing("JOINT.current", "off"), REPORTED_S, PHASES),
    FailureMode("current_silent", failing("JOINT.current", "off"), 1.0),
    FailureMode("heartbeat_silent", failing("JOINT.heartbeat", "off"), 1.0),
    FailureMode("temperature_silent", failing("JOINT.temperature", "off"), 1.5),
    FailureMode("voltage_silent", failing("JOINT.voltage", "off"), 1.5),
    FailureMode("drive_error", overcurrent, phases=PHASES),
    FailureMode("drive_error", watchdog_ran_out, 0.5, MOVING, "by its watchdog", no_commands=True),
    FailureMode("drive_error", forged(Forgery.EMERGENCY_STOP), 0.5, MOVING, "by another program's stop"),
    FailureMode("drive_disarmed", left_closed_loop, phases=MOVING),
    FailureMode("drive_energised", other_master, 1.0, ("idle",)),
    FailureMode("drive_restarted", restart, 2.0),
    FailureMode("drive_version", forged(Forgery.OLD_FIRMWARE), phases=("idle", "stance")),
    FailureMode("duplicate_node_id", duplicate(0.3), 1.6),
    FailureMode("wrong_drive", forged(Forgery.OTHER_DRIVE), phases=("idle",)),
    FailureMode("drive_settings", forged(Forgery.OTHER_SETTING), 2.5, ("idle",)),
    FailureMode("foreign_commands", commanded_by_another(0.3, every=2, heard=True), 1.0),
    FailureMode(
        "setpoint_mismatch", commanded_by_another(1.0, every=10, heard=False), 1.0, MOVING, "every tenth command"
    ),
    FailureMode(
        "setpoint_mismatch", commanded_by_another(-0.4, every=2, heard=False), 1.0, MOVING, "every second command"
    ),
    FailureMode("watchdog_unknown", forged(Forgery.STARTING), phases=("idle",)),
    FailureMode("watchdog_off", forged(Forgery.WATCHDOG_OFF), phases=("idle", "stance")),
    # buses
    FailureMode("bus_warning", failing("bus.BUS", "warning")),
    FailureMode("bus_passive", failing("bus.BUS", "passive")),
    FailureMode("bus_off", failing("bus.BUS", "bus-off"), 1.0, PHASES, no_commands=True),
    FailureMode("bus_refuses", failing("bus.BUS", "stuck"), no_commands=True),
    # joints and motors
    FailureMode("joint_position", out_of_range),
    FailureMode("joint_velocity", moved_at_speed(45.0), REPORTED_S),
    FailureMode("joint_moving", moved_at_speed(2.0), REPORTED_S, ("idle",)),
    FailureMode("joint_current", current_reported(40.0)),
    FailureMode("joint_not_following", blocked, 3.0, ("hold",)),
    FailureMode("joint_runaway", drive_with(commutation_error_deg=180.0), 1.0, GAIT, turns=True),
    FailureMode("joint_oscillating", stiff, 1.0, ("swing", "stopping")),
    FailureMode("following_error", jammed, 6.0, ("stance", "swing"), turns=True),
    FailureMode("damping_failed", damped_against_command, 0.3, MOVING),
    FailureMode("encoder_jump", drive_with(encoder_offset_rad=0.6), phases=PHASES),
    FailureMode("encoder_stuck", failing("JOINT.position", "stuck"), 1.0, GAIT, turns=True),
    FailureMode(
        "encoder_stuck", failing("JOINT.position", "stuck"), 1.0, PHASES, "in any phase", demands_reaction=False
    ),
    FailureMode("encoder_stuck", drive_with(encoder_frozen=True), 1.0, PHASES, "at zero speed", demands_reaction=False),
    FailureMode("torque_missing", current_reversed, phases=MOVING),
    *(
        FailureMode(
            "wrong_motor",
            drive_with(commutation_error_deg=error_deg),
            1.0,
            (*MOVING, "recovery"),
            f"torque x {factor}",
            demands_reaction=False,
        )
        for factor, error_deg in COMMUTATION_ERRORS_DEG.items()
    ),
    *_foreign_modes(),
    *_degraded_modes(),
    FailureMode("motor_overheating", drive_with(temperature_c=82.0), phases=PHASES),
    FailureMode("motor_hot", drive_with(temperature_c=95.0)),
    FailureMode("winding_overheating", heated(83.0)),
    FailureMode("winding_hot", heated(93.0)),
    FailureMode("voltage_low", drive_with(bus_voltage_v=19.0)),
    FailureMode("voltage_under", drive_with(bus_voltage_v=17.0)),
    FailureMode("flipper_stuck", recovery_given_up, phases=("recovery",)),
    FailureMode("arming_failed", never_in_closed_loop, 3.0, ("arming",)),
    # the loop
    FailureMode("torque_not_finite", gains_of_nan, phases=MOVING),
    FailureMode("command_refused", five_newton_metres, phases=PHASES),
    FailureMode("loop_overrun", loop_stalled(1)),
    FailureMode("loop_lagging", loop_stalled(7), bound_ticks=2),
    FailureMode("loop_lagging", failing("loop", "slow"), 1.0, ("hold", "stance"), "every tick too long"),
    FailureMode("loop_stalled", failing("loop", "stuck"), phases=PHASES),
    FailureMode("loop_crawling", loop_stalled(20), phases=PHASES),
    FailureMode("clock_step", failing("clock", "garbage")),
    FailureMode("estimate_wild", absurd_stride, phases=GAIT),
    FailureMode("pose_lost", failing("pose", "off")),
    FailureMode("lease_lost", lease_hung_up, phases=PHASES),
    # the log
    FailureMode("disk_low", writer_reports(free_fraction=0.02)),
    FailureMode("log_unwritable", writer_reports(problem=NO_SPACE)),
    FailureMode("disk_slow", writer_reports(slowest_write_s=5.0)),
    FailureMode("recorder_dead", writer_reports(alive=False)),
    FailureMode("rows_lost", writer_lost_rows),
    FailureMode("frames_lost", port_lost_frames),
    # the daemon
    FailureMode("daemon_killed", killed, 1.0, PHASES),
    FailureMode("daemon_hung", loop_stalled(760), 2.2, PHASES),
    *(
        FailureMode("bug_in_the_tick", bug_in(path), 0.5, BUG_PHASES, f"while {part}", ends_daemon=True)
        for part, path in BUGGY_METHODS.items()
    ),
)
BY_NAME = {mode.name: mode for mode in FAILURE_MODES}

ABSENT_DRIVE = (  # faults of a drive from which no messages arrive
    "drive_late", "current_stale", "position_stale", "drive_quiet", "drive_silent", "heartbeat_silent",
    "temperature_silent", "voltage_silent", "drive_energised", "drive_error", "drive_restarted", "drive_version",
    "watchdog_unknown", "wrong_drive",
)  # fmt: skip
IDLE_DRIVE = ("drive_error", "drive_disarmed", "torque_missing")  # faults of a drive that no commands reach
# Other faults that may be reported with a fault, because they are true as well.
CONSEQUENCES: dict[str, tuple[str, ...]] = {
    "drive_quiet": ("drive_late", "position_stale", "current_stale"),
    "drive_silent": ABSENT_DRIVE,
    "position_stale": ("drive_late",),
    "position_silent": ("drive_late", "position_stale"),
    "current_stale": ("drive_late",),
    "current_silent": ("drive_late", "current_stale", "torque_missing"),
    "heartbeat_silent": ("drive_energised",),
    "drive_settings": ("foreign_commands",),  # by which another program changed them
    "drive_energised": ("foreign_commands",),  # by which another program closed the loop
    "drive_error": ("drive_disarmed", "torque_missing"),
    "drive_restarted": ABSENT_DRIVE,
    # the second drive reports another angle, and its own set-points
    "duplicate_node_id": (
        *("encoder_jump", "joint_moving", "drive_disarmed", "joint_position", "encoder_stuck", "setpoint_mismatch"),
    ),
    "setpoint_mismatch": ("joint_runaway",),  # in that torque's direction
    "watchdog_unknown": ("drive_error", "drive_restarted", "drive_version", "wrong_drive"),
    "bus_off": (*ABSENT_DRIVE, *IDLE_DRIVE, "bus_refuses"),
    "bus_refuses": (*IDLE_DRIVE, "joint_runaway"),  # at the last torque
    "joint_position": ("encoder_jump",),
    "encoder_stuck": ("encoder_jump",),  # when it reports angles again
    "encoder_jump": ("joint_moving",),
    "joint_velocity": ("encoder_stuck", "joint_runaway"),  # its angle is held and its speed is not, nor commanded
    "joint_oscillating": ("joint_runaway",),
    "damping_failed": ("encoder_jump", "torque_missing", "joint_moving"),
    "motor_overheating": ("winding_overheating",),
    "motor_hot": ("winding_hot",),
    "loop_lagging": ("loop_overrun", "joint_oscillating"),  # the last torque takes a joint away from its target
    "loop_stalled": ("loop_lagging",),
    "loop_crawling": ("loop_stalled", "loop_lagging"),
    "daemon_hung": (*IDLE_DRIVE, "loop_stalled", "loop_crawling", "loop_lagging", "arming_failed"),
}
