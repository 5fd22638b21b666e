"""Every way to every fault, and the phases in which it is made: at least one way for each kind of fault.

Beside the kinds of control/faults.py there is a daemon that dies, hangs or meets a bug in each stage of its tick,
and nothing at all, as the control group.
"""

from __future__ import annotations

from dataclasses import dataclass

from control.faults import FAULT_KINDS, FaultKind
from control.records import JOINTS
from experiments.faults.causes import (
    Cause,
    blocked,
    current_reported,
    drive_with,
    duplicate,
    failing,
    forged,
    given_up,
    left_closed_loop,
    never_in_closed_loop,
    other_master,
    out_of_range,
    overcurrent,
    restart,
    watchdog_ran_out,
    whirled,
    wrong_way,
)
from experiments.faults.loop_causes import (
    bug_in,
    five_newton_metres,
    gains_of_nan,
    heated,
    hung_up,
    killed,
    nothing,
    port_lost_frames,
    stands,
    wild_stride,
    writer_lost_rows,
    writer_tells,
)
from experiments.faults.phases import EVERYWHERE, GAIT, PHASES
from simulation.devices.drive import Forgery

REPORTED_S = 0.0  # a cause that lasts until its fault is told
TURNING = {"insertion": "adduction", "stance": "sweep", "extraction": "adduction", "swing": "sweep"}
MOVING = ("hold", *GAIT, "stopping")


@dataclass(frozen=True)
class Way:
    """`fault` is its kind, or what else it is; `lasts_s` is the time from the cause until it is gone."""

    fault: str
    cause: Cause
    lasts_s: float = 0.5
    phases: tuple[str, ...] = EVERYWHERE
    how: str = ""  # where there is more than one way to a fault
    deaf: bool = False  # commands do not reach a drive meanwhile: only its watchdog takes its torque
    ends_daemon: bool = False
    bound_ticks: int | None = None  # where this way shows sooner than the kind's bound says
    turns: bool = False  # it shows at a joint that turns only

    @property
    def name(self) -> str:
        return f"{self.fault}, {self.how}" if self.how else self.fault

    def joints(self, phase: str) -> tuple[str, ...]:
        """Of which one is drawn."""
        turning = TURNING.get(phase, "") if self.turns else ""
        return tuple(joint for joint in JOINTS if joint.endswith(turning))

    @property
    def kind(self) -> FaultKind | None:
        return FAULT_KINDS.get(self.fault)


BUGS = {
    "reading drives": "drives.read",
    "reading pose": "pose.read",
    "learning": "learning.update",
    "choosing depth": "learning.step",
    "watching faults": "fault_monitor.update",
    "control": "controller.step",
    "sending": "drives.send",
    "recording": "recorder.put",
}
DYING = ("hold", *GAIT, "recovery")

WAYS: tuple[Way, ...] = (
    Way("none", nothing, 1.0, PHASES),
    # signals of a drive
    Way("drive_late", failing("JOINT", "off"), REPORTED_S, deaf=True),
    Way("drive_quiet", failing("JOINT", "off"), REPORTED_S, PHASES, deaf=True),
    Way("drive_silent", failing("JOINT", "off"), 1.0, PHASES, deaf=True),
    Way("position_stale", failing("JOINT.position", "off"), REPORTED_S),
    Way("position_silent", failing("JOINT.position", "off"), 1.0),
    Way("current_stale", failing("JOINT.current", "off"), REPORTED_S, PHASES),
    Way("current_silent", failing("JOINT.current", "off"), 1.0),
    Way("heartbeat_silent", failing("JOINT.heartbeat", "off"), 1.0),
    Way("temperature_silent", failing("JOINT.temperature", "off"), 1.5),
    Way("voltage_silent", failing("JOINT.voltage", "off"), 1.5),
    Way("drive_error", overcurrent, phases=PHASES),
    Way("drive_error", watchdog_ran_out, 0.5, MOVING, "by its watchdog", deaf=True),
    Way("drive_error", forged(Forgery.EMERGENCY_STOP), 0.5, MOVING, "by a stranger's stop"),
    Way("drive_disarmed", left_closed_loop, phases=MOVING),
    Way("drive_energised", other_master, 1.0, ("idle",)),
    Way("drive_restarted", restart, 2.0),
    Way("drive_version", forged(Forgery.OLD_FIRMWARE), phases=("idle", "stance")),
    Way("duplicate_node_id", duplicate(0.3), 1.6),
    Way("watchdog_unknown", forged(Forgery.STARTING), phases=("idle",)),
    Way("watchdog_off", forged(Forgery.WATCHDOG_OFF), phases=("idle", "stance")),
    # buses
    Way("bus_warning", failing("bus.BUS", "warning")),
    Way("bus_passive", failing("bus.BUS", "passive")),
    Way("bus_off", failing("bus.BUS", "bus-off"), 1.0, PHASES, deaf=True),
    Way("bus_refuses", failing("bus.BUS", "stuck"), deaf=True),
    # joints and motors
    Way("joint_position", out_of_range),
    Way("joint_velocity", whirled(45.0), REPORTED_S),
    Way("joint_moving", whirled(2.0), REPORTED_S, ("idle",)),
    Way("joint_current", current_reported(40.0)),
    Way("joint_not_following", blocked, 3.0, ("hold", *GAIT)),
    Way("encoder_jump", drive_with(encoder_offset_rad=0.6), phases=PHASES),
    Way("encoder_stuck", failing("JOINT.position", "stuck"), 1.0, GAIT, turns=True),
    Way("torque_missing", wrong_way, phases=MOVING),
    Way("motor_overheating", drive_with(temperature_c=82.0), phases=PHASES),
    Way("motor_hot", drive_with(temperature_c=95.0)),
    Way("winding_overheating", heated(83.0)),
    Way("winding_hot", heated(93.0)),
    Way("voltage_low", drive_with(bus_voltage_v=19.0)),
    Way("voltage_under", drive_with(bus_voltage_v=17.0)),
    Way("flipper_stuck", given_up, phases=("recovery",)),
    Way("arming_failed", never_in_closed_loop, 3.0, ("arming",)),
    # the loop
    Way("torque_not_finite", gains_of_nan, phases=MOVING),
    Way("command_refused", five_newton_metres, phases=PHASES),
    Way("loop_overrun", stands(1)),
    Way("loop_lagging", stands(7), bound_ticks=2),
    Way("loop_lagging", failing("loop", "slow"), 1.0, ("hold", "stance"), "every tick too long"),
    Way("loop_stalled", failing("loop", "stuck"), phases=PHASES),
    Way("loop_crawling", stands(20), phases=PHASES),
    Way("clock_step", failing("clock", "garbage")),
    Way("estimate_wild", wild_stride, phases=GAIT),
    Way("pose_lost", failing("pose", "off")),
    Way("lease_lost", hung_up, phases=PHASES),
    # the log
    Way("disk_low", writer_tells(free_fraction=0.02)),
    Way("log_unwritable", writer_tells(problem="Nothing can be written to the log: No space left on device.")),
    Way("disk_slow", writer_tells(slowest_write_s=5.0)),
    Way("recorder_dead", writer_tells(alive=False)),
    Way("rows_lost", writer_lost_rows),
    Way("frames_lost", port_lost_frames),
    # the daemon
    Way("daemon_killed", killed, 1.0, PHASES),
    Way("daemon_hung", stands(760), 2.2, PHASES),
    *(
        Way("bug_in_the_tick", bug_in(path), 0.5, DYING, f"while {stage}", ends_daemon=True)
        for stage, path in BUGS.items()
    ),
)
BY_NAME = {way.name: way for way in WAYS}

AWAY = (
    "drive_late", "current_stale", "position_stale", "drive_quiet", "drive_silent", "heartbeat_silent",
    "temperature_silent", "voltage_silent", "drive_energised", "drive_error", "drive_restarted", "drive_version",
    "watchdog_unknown",
)  # fmt: skip
DEAF = ("drive_error", "drive_disarmed", "torque_missing")
BRINGS: dict[str, tuple[str, ...]] = {
    "drive_quiet": ("drive_late", "position_stale", "current_stale"),
    "drive_silent": AWAY,
    "position_stale": ("drive_late",),
    "position_silent": ("drive_late", "position_stale"),
    "current_stale": ("drive_late",),
    "current_silent": ("drive_late", "current_stale", "torque_missing"),
    "heartbeat_silent": ("drive_energised",),
    "drive_error": ("drive_disarmed", "torque_missing"),
    "drive_restarted": AWAY,
    "duplicate_node_id": (
        "encoder_jump",
        "joint_moving",
        "drive_disarmed",
        "joint_position",
    ),  # the other one's encoder is elsewhere
    "watchdog_unknown": ("drive_error", "drive_restarted", "drive_version"),
    "bus_off": (*AWAY, *DEAF, "bus_refuses"),
    "bus_refuses": DEAF,
    "joint_position": ("encoder_jump",),
    "encoder_stuck": ("encoder_jump",),  # when it goes on
    "encoder_jump": ("joint_moving",),
    "joint_velocity": ("encoder_stuck",),  # it is held where it is and told to be fast
    "motor_overheating": ("winding_overheating",),
    "motor_hot": ("winding_hot",),
    "loop_lagging": ("loop_overrun",),
    "loop_stalled": ("loop_lagging",),
    "loop_crawling": ("loop_stalled", "loop_lagging"),
    "daemon_hung": (*DEAF, "loop_stalled", "loop_crawling", "loop_lagging", "arming_failed"),
}  # what else may be told, since it is true as well
