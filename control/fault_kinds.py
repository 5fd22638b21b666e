"""The table of all faults, from which docs/faults.md, `mudskipper check` and the modes' reactions are made.

A bound is the number of 380 Hz ticks from the cause to the reaction with the default bounds of [faults] and the
messages' periods of the README: position and current every 2 ms, everything else every 100 ms (38 ticks). A loop lags
that misses six ticks in a row, which shows at once, or a tenth of 100, which takes as many at the most.
"""

from __future__ import annotations

from control.faults import Blocks, Clears, Fault, FaultKind, Reaction

NONE, WARN, HOLD, SOFT_STOP, DAMPING, DRIVES_IDLE = Reaction
NO, UNLESS_FORCED, ALWAYS = Blocks
WHEN_GONE, BY_HAND, BY_RESTART = Clears

WIRING = "check its power, wiring, node id and message periods (README, 'Setting up the drives')"
FIX = "mend the cause, then 'mudskipper clear'"
COOL = "let it cool; walk less deep or slower"
REPORT = "this is a bug: keep the log, report it, and restart the daemon"
WIRES = "check wiring, termination and bit rate; 'ip -s -d link show' tells more"
BUSY = "end what else runs on this computer; see 'mudskipper check' for real-time warnings"
FREE = "free space on the log's disk, or lower log.quota_bytes"
WRITE = "mend what the sentence names: the log's folder, its permissions, or the disk under it"

_ROWS: tuple[FaultKind, ...] = (
    # signals of a drive
    FaultKind("drive_late", "drive", WARN, NO, WHEN_GONE, 4, "Position or current is older than two ticks.", WIRING),
    FaultKind("drive_quiet", "drive", DAMPING, ALWAYS, WHEN_GONE, 5, "Neither came for three ticks.", WIRING),
    FaultKind("drive_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 12, "Neither came for ten ticks.", WIRING),
    FaultKind("position_stale", "drive", DAMPING, ALWAYS, WHEN_GONE, 5, "No position for three ticks.", WIRING),
    FaultKind("position_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 12, "No position for ten ticks.", WIRING),
    FaultKind("current_stale", "drive", HOLD, ALWAYS, WHEN_GONE, 5, "No current for three ticks.", WIRING),
    FaultKind("current_silent", "drive", SOFT_STOP, ALWAYS, BY_HAND, 12, "No current for ten ticks.", WIRING),
    FaultKind("heartbeat_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 192, "No heartbeat for 0.5 s.", WIRING),
    FaultKind("temperature_silent", "drive", SOFT_STOP, ALWAYS, WHEN_GONE, 382, "No temperature for 1 s.", WIRING),
    FaultKind("voltage_silent", "drive", WARN, UNLESS_FORCED, WHEN_GONE, 382, "No bus voltage for 1 s.", WIRING),
    FaultKind("drive_error", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 41, "The drive reports an error.", FIX),
    FaultKind("drive_disarmed", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 41, "It left closed loop by itself.", FIX),
    FaultKind(
        "drive_energised", "drive", WARN, ALWAYS, WHEN_GONE, 117,
        "It is energised though nobody armed it.", "end what else commands it, or 'mudskipper disarm'",
    ),
    FaultKind(
        "drive_restarted", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 580,
        "The drive started anew.", "check its supply and its joint's angle, then 'mudskipper clear'", True,
    ),
    FaultKind(
        "drive_version", "drive", NONE, ALWAYS, WHEN_GONE, 2,
        "Its firmware is unknown or of another family.", "install firmware 0.6, whose messages this version knows",
    ),
    FaultKind(
        "drive_twins", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 500,
        "Two drives send under one node id.", "give every drive on a bus a node id of its own, one at a time",
    ),
    FaultKind(
        "watchdog_unknown", "watchdog", NONE, UNLESS_FORCED, WHEN_GONE, 2,
        "The drive's watchdog could not be read back.", "see README, 'Setting up the drives', or arm with --force",
    ),
    FaultKind(
        "watchdog_off", "watchdog", NONE, ALWAYS, WHEN_GONE, 2,
        "The drive's watchdog is off or too slow.", "set enable_watchdog and watchdog_timeout = 0.1, and save",
    ),
    # buses
    FaultKind("bus_warning", "bus", WARN, NO, WHEN_GONE, 2, "The controller counts many errors.", WIRES),
    FaultKind("bus_passive", "bus", WARN, ALWAYS, WHEN_GONE, 2, "The controller is error-passive.", WIRES),
    FaultKind("bus_off", "bus", DAMPING, ALWAYS, BY_HAND, 2, "The controller has left the bus.", WIRES),
    FaultKind("bus_refuses", "bus", DAMPING, ALWAYS, WHEN_GONE, 5, "Commands were lost in 3 ticks in a row.", WIRES),
    FaultKind("frames_lost", "bus", WARN, NO, WHEN_GONE, 2, "Frames came faster than they were read.", BUSY),
    # joints and motors
    FaultKind(
        "joint_position", "joint", DAMPING, ALWAYS, BY_HAND, 3,
        "A joint is outside of its range.", "move it back by hand, then 'mudskipper clear'",
    ),
    FaultKind("joint_velocity", "joint", DAMPING, ALWAYS, BY_HAND, 5, "A joint is faster than its limit allows.", FIX),
    FaultKind(
        "joint_moving", "joint", NONE, ALWAYS, WHEN_GONE, 40,
        "A joint moves while it should rest.", "wait until it is at rest",
    ),
    FaultKind(
        "joint_current", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 6,
        "A motor takes more current than its limit.", "check current limits and torque constant, then clear",
    ),
    FaultKind(
        "joint_not_following", "joint", SOFT_STOP, ALWAYS, BY_HAND, 765,
        "A joint stands still at full torque for 2 s.", "free what holds it, then 'mudskipper clear'",
    ),
    FaultKind(
        "encoder_jump", "joint", DAMPING, ALWAYS, BY_HAND, 3,
        "A position jumped farther than a joint can move.", "check encoder, magnet and cable, then clear",
    ),
    FaultKind(
        "encoder_stuck", "joint", DAMPING, ALWAYS, BY_HAND, 120,
        "A position stands still while the joint moves.", "check encoder, magnet and cable, then clear",
    ),
    FaultKind(
        "torque_missing", "joint", SOFT_STOP, ALWAYS, BY_HAND, 45,
        "A motor's current is not that of its torque for 0.1 s.",
        "check the drive's limits, its torque constant and cables, then clear",
    ),
    FaultKind("motor_overheating", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 100, "A motor is nearly too hot.", COOL),
    FaultKind("motor_hot", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 100, "A motor is too hot.", COOL),
    FaultKind(
        "winding_overheating", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 3,
        "By its currents a winding is nearly too hot.", COOL,
    ),
    FaultKind("winding_hot", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 3, "By its currents a winding is too hot.", COOL),
    FaultKind("voltage_low", "joint", WARN, NO, WHEN_GONE, 100, "The supply is low.", "charge or change the battery"),
    FaultKind(
        "voltage_under", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 100,
        "The supply is too low.", "charge or change the battery",
    ),
    FaultKind(
        "flipper_stuck", "flipper", DAMPING, ALWAYS, BY_HAND, 2,
        "The mud keeps a flipper whatever was tried.", "free it by hand, then clear, and walk less deep",
    ),
    FaultKind(
        "arming_failed", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 765,
        "A drive did not go into closed loop.", FIX,
    ),
    # the loop itself
    FaultKind("torque_not_finite", "loop", DRIVES_IDLE, ALWAYS, BY_RESTART, 2, "A torque was no number.", REPORT),
    FaultKind(
        "command_refused", "loop", DRIVES_IDLE, ALWAYS, BY_RESTART, 2,
        "The gate to the wire refused a command.", REPORT,
    ),
    FaultKind("loop_overrun", "loop", WARN, NO, WHEN_GONE, 1, "A tick was missed.", BUSY),
    FaultKind("loop_lagging", "loop", SOFT_STOP, ALWAYS, WHEN_GONE, 101, "The loop does not keep its rate.", BUSY),
    FaultKind(
        "loop_crawling", "loop", DRIVES_IDLE, ALWAYS, BY_HAND, 25,
        "Commands leave too seldom to brake a joint.", BUSY,
    ),
    FaultKind("loop_stalled", "loop", DAMPING, ALWAYS, WHEN_GONE, 2, "The loop stood still.", BUSY),
    FaultKind(
        "clock_step", "clock", WARN, NO, WHEN_GONE, 2,
        "The clock on the wall was set.", "nothing: ages come from another clock; a log's dates may jump",
    ),
    FaultKind(
        "estimate_wild", "estimator", WARN, NO, WHEN_GONE, 2,
        "A coefficient or a depth came out beyond all bounds.", "the first depth is taken; look at the log's strides",
    ),
    FaultKind("pose_lost", "pose", WARN, NO, WHEN_GONE, 22, "The body's place is not told any more.",
              "check motion capture and its bridge"),
    FaultKind(
        "lease_lost", "lease", SOFT_STOP, ALWAYS, WHEN_GONE, 2,
        "Who promised to attend the robot is gone.", "look after the robot, then arm again",
    ),
    # the log
    FaultKind("disk_low", "log", WARN, UNLESS_FORCED, WHEN_GONE, 400, "The log's disk is nearly full.", FREE),
    FaultKind("log_unwritable", "log", WARN, UNLESS_FORCED, WHEN_GONE, 400, "The log cannot be written.", WRITE),
    FaultKind("disk_slow", "log", WARN, NO, WHEN_GONE, 400, "The log's disk is slow.", "use another card or disk"),
    FaultKind(
        "recorder_dead", "log", WARN, UNLESS_FORCED, WHEN_GONE, 2,
        "The log's writer has died: nothing is recorded.", "restart the daemon",
    ),
    FaultKind("rows_lost", "log", WARN, NO, WHEN_GONE, 2, "Rows were lost.", "use another card or disk"),
)  # fmt: skip

KINDS: dict[str, FaultKind] = {kind.name: kind for kind in _ROWS}


def make_fault(name: str, subject: str, message: str) -> Fault:
    return Fault(KINDS[name], subject, message)
