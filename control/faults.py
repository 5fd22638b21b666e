"""Faults as data: which there are, how hard the robot reacts to each, whether each blocks arming, and what ends it.

The modes know reactions only, never single faults: the worst reaction wins. The texts that people read about a fault
are made where a person reads them (firmware_host/fault_texts.py).
"""

from __future__ import annotations

from enum import Enum, IntEnum, StrEnum
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
    """What ends a fault that occurred while torque was on. While torque is off, a fault ends with its cause."""

    WHEN_GONE = "when its cause has been gone for a while"
    BY_HAND = "by 'mudskipper clear', once its cause is gone"
    BY_RESTART = "by a restart of the daemon: it is a bug"


NONE, WARN, HOLD, SOFT_STOP, DAMPING, DRIVES_IDLE = Reaction
NO, UNLESS_FORCED, ALWAYS = Blocks
WHEN_GONE, BY_HAND, BY_RESTART = Clears


class FaultKind(StrEnum):
    """Every fault that the robot can detect.

    The columns are: name, line of `mudskipper check` that it belongs to, reaction, blocking of arming, clearing, and
    bound. The bound is the largest number of 380 Hz ticks from the cause to the reaction, with the default bounds of
    [faults] and drives that send position and current every 2 ms and everything else every 100 ms (38 ticks).
    """

    part: str
    reaction: Reaction
    blocks: Blocks
    clears: Clears
    bound_ticks: int
    latches_idle: bool  # it also has to be cleared if it occurred while torque was off

    def __new__(
        cls,
        name: str,
        part: str,
        reaction: Reaction,
        blocks: Blocks,
        clears: Clears,
        bound_ticks: int,
        latches_idle: bool = False,
    ) -> FaultKind:
        kind = str.__new__(cls, name)
        kind._value_ = name
        kind.part, kind.reaction, kind.blocks, kind.clears = part, reaction, blocks, clears
        kind.bound_ticks, kind.latches_idle = bound_ticks, latches_idle
        return kind

    # signals of a drive
    DRIVE_LATE = "drive_late", "drive", WARN, NO, WHEN_GONE, 4
    DRIVE_QUIET = "drive_quiet", "drive", DAMPING, ALWAYS, WHEN_GONE, 5
    DRIVE_SILENT = "drive_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 12
    POSITION_STALE = "position_stale", "drive", DAMPING, ALWAYS, WHEN_GONE, 5
    POSITION_SILENT = "position_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 12
    CURRENT_STALE = "current_stale", "drive", HOLD, ALWAYS, WHEN_GONE, 5
    CURRENT_SILENT = "current_silent", "drive", SOFT_STOP, ALWAYS, BY_HAND, 12
    HEARTBEAT_SILENT = "heartbeat_silent", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 192
    TEMPERATURE_SILENT = "temperature_silent", "drive", SOFT_STOP, ALWAYS, WHEN_GONE, 382
    VOLTAGE_SILENT = "voltage_silent", "drive", WARN, UNLESS_FORCED, WHEN_GONE, 382
    # what a drive reports of itself
    DRIVE_ERROR = "drive_error", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 41
    DRIVE_DISARMED = "drive_disarmed", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 41
    DRIVE_ENERGISED = "drive_energised", "drive", WARN, ALWAYS, WHEN_GONE, 117
    DRIVE_RESTARTED = "drive_restarted", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 580, True
    DRIVE_VERSION = "drive_version", "drive", NONE, ALWAYS, WHEN_GONE, 2
    DUPLICATE_NODE_ID = "duplicate_node_id", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 500
    WRONG_DRIVE = "wrong_drive", "drive", NONE, ALWAYS, WHEN_GONE, 2
    DRIVE_SETTINGS = "drive_settings", "drive", NONE, ALWAYS, WHEN_GONE, 800
    FOREIGN_COMMANDS = "foreign_commands", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 2
    SETPOINT_MISMATCH = "setpoint_mismatch", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 120
    WATCHDOG_UNKNOWN = "watchdog_unknown", "watchdog", NONE, UNLESS_FORCED, WHEN_GONE, 2
    WATCHDOG_OFF = "watchdog_off", "watchdog", NONE, ALWAYS, WHEN_GONE, 2
    ARMING_FAILED = "arming_failed", "drive", DRIVES_IDLE, ALWAYS, BY_HAND, 765
    # buses
    BUS_WARNING = "bus_warning", "bus", WARN, NO, WHEN_GONE, 2
    BUS_PASSIVE = "bus_passive", "bus", WARN, ALWAYS, WHEN_GONE, 2
    BUS_OFF = "bus_off", "bus", DAMPING, ALWAYS, BY_HAND, 2
    BUS_REFUSES = "bus_refuses", "bus", DAMPING, ALWAYS, WHEN_GONE, 5
    FRAMES_LOST = "frames_lost", "bus", WARN, NO, WHEN_GONE, 2
    # joints and motors
    JOINT_POSITION = "joint_position", "joint", DAMPING, ALWAYS, BY_HAND, 3
    JOINT_VELOCITY = "joint_velocity", "joint", DAMPING, ALWAYS, BY_HAND, 5
    JOINT_MOVING = "joint_moving", "joint", NONE, ALWAYS, WHEN_GONE, 40
    JOINT_CURRENT = "joint_current", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 6
    JOINT_NOT_FOLLOWING = "joint_not_following", "joint", SOFT_STOP, ALWAYS, BY_HAND, 765
    JOINT_RUNAWAY = "joint_runaway", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 60
    JOINT_OSCILLATING = "joint_oscillating", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 120
    FOLLOWING_ERROR = "following_error", "joint", DAMPING, ALWAYS, BY_HAND, 1900
    DAMPING_FAILED = "damping_failed", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 45
    ENCODER_JUMP = "encoder_jump", "joint", DAMPING, ALWAYS, BY_HAND, 3
    ENCODER_STUCK = "encoder_stuck", "joint", DAMPING, ALWAYS, BY_HAND, 120
    TORQUE_MISSING = "torque_missing", "joint", SOFT_STOP, ALWAYS, BY_HAND, 45
    MOTOR_OVERHEATING = "motor_overheating", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 100
    MOTOR_HOT = "motor_hot", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 100
    WINDING_OVERHEATING = "winding_overheating", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 3
    WINDING_HOT = "winding_hot", "joint", DRIVES_IDLE, ALWAYS, BY_HAND, 3
    VOLTAGE_LOW = "voltage_low", "joint", WARN, NO, WHEN_GONE, 100
    VOLTAGE_UNDER = "voltage_under", "joint", SOFT_STOP, ALWAYS, WHEN_GONE, 100
    FLIPPER_STUCK = "flipper_stuck", "flipper", DAMPING, ALWAYS, BY_HAND, 2
    # the loop itself
    TORQUE_NOT_FINITE = "torque_not_finite", "loop", DRIVES_IDLE, ALWAYS, BY_RESTART, 2
    COMMAND_REFUSED = "command_refused", "loop", DRIVES_IDLE, ALWAYS, BY_RESTART, 2
    LOOP_OVERRUN = "loop_overrun", "loop", WARN, NO, WHEN_GONE, 1
    LOOP_LAGGING = "loop_lagging", "loop", SOFT_STOP, ALWAYS, WHEN_GONE, 101
    LOOP_CRAWLING = "loop_crawling", "loop", DRIVES_IDLE, ALWAYS, BY_HAND, 25
    LOOP_STALLED = "loop_stalled", "loop", DAMPING, ALWAYS, WHEN_GONE, 2
    CLOCK_STEP = "clock_step", "clock", WARN, NO, WHEN_GONE, 2
    # a stride closes in 25 to 40 units, one a tick
    ESTIMATE_WILD = "estimate_wild", "estimator", WARN, NO, WHEN_GONE, 60
    POSE_LOST = "pose_lost", "pose", WARN, NO, WHEN_GONE, 22
    LEASE_LOST = "lease_lost", "lease", SOFT_STOP, ALWAYS, WHEN_GONE, 2
    # the log
    DISK_LOW = "disk_low", "log", WARN, UNLESS_FORCED, WHEN_GONE, 400
    LOG_UNWRITABLE = "log_unwritable", "log", WARN, UNLESS_FORCED, WHEN_GONE, 400
    DISK_SLOW = "disk_slow", "log", WARN, NO, WHEN_GONE, 400
    RECORDER_DEAD = "recorder_dead", "log", WARN, UNLESS_FORCED, WHEN_GONE, 2
    ROWS_LOST = "rows_lost", "log", WARN, NO, WHEN_GONE, 2

    def fault(self, subject: str = "", **values: float | str) -> Fault:
        """A fault of this kind; `values` are the measured values that its message shows, in the message's units."""
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
        """The line of `mudskipper check` that shows this fault."""
        return f"{self.kind.part}.{self.subject}" if self.subject else self.kind.part

    def with_values(self, **values: float | str) -> Fault:
        """The same fault with more values for its message."""
        return self._replace(values=(*self.values, *values.items()))


FAULT_KINDS: dict[str, FaultKind] = {kind.value: kind for kind in FaultKind}
