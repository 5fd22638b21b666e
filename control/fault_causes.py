"""Groups present faults by their cause: a bus that goes off lets a dozen faults of its drives follow.

A fault follows from another one if the table below says so, if both concern the same part of the robot, and if it did
not begin long before the other. Faults of the same kind that follow from nothing share one cause, unless they differ in
their reason. The reaction of the robot does not depend on this: every fault counts there. A kind that is not in the
table is a cause of its own.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from control.faults import Blocks, Fault, FaultKind, Reaction

BEFORE_S = 1.0  # a consequence may be detected this long before its cause: a heartbeat is missed after 0.5 s
RESTART_S = 5.0  # before a restart, which is known once the drive has booted
ANSWERED_S = 2.0  # after all drives were heard first: each was asked for its settings four times
K = FaultKind
ASKED = (K.DRIVE_VERSION, K.WRONG_DRIVE, K.WATCHDOG_UNKNOWN)  # until the drive has answered
SIGNALS = (
    *(K.DRIVE_SILENT, K.DRIVE_QUIET, K.POSITION_SILENT, K.CURRENT_SILENT, K.HEARTBEAT_SILENT, K.TEMPERATURE_SILENT),
    *(K.VOLTAGE_SILENT, K.POSITION_STALE, K.CURRENT_STALE, K.DRIVE_LATE),
)
POWERLESS = (K.DRIVE_DISARMED, K.ARMING_FAILED, K.TORQUE_MISSING, K.JOINT_NOT_FOLLOWING, K.ENCODER_STUCK)
UNREACHED = (  # its watchdog trips, and its settings are unknown
    *(K.DRIVE_ERROR, K.SETPOINT_MISMATCH, *POWERLESS, K.DRIVE_ENERGISED, K.WATCHDOG_UNKNOWN, K.WRONG_DRIVE),
    K.DRIVE_VERSION,
)
LATE = (K.LOOP_OVERRUN, K.FRAMES_LOST, *SIGNALS)  # signals of drives that were not asked

CONSEQUENCES: dict[FaultKind, tuple[FaultKind, ...]] = {  # what can follow from a fault; the deepest causes first
    K.LOOP_STALLED: (K.LOOP_CRAWLING, K.LOOP_LAGGING, K.LEASE_LOST, *LATE, *UNREACHED),
    K.LOOP_CRAWLING: (K.LOOP_LAGGING, *LATE),
    K.LOOP_LAGGING: LATE,
    K.POWER_CUT: (
        *(K.VOLTAGE_UNDER, K.VOLTAGE_LOW, K.BUS_PASSIVE, K.BUS_REFUSES, K.BUS_WARNING, K.DRIVE_RESTARTED),
        *(*SIGNALS, *UNREACHED),
    ),
    K.VOLTAGE_UNDER: (K.VOLTAGE_LOW, K.DRIVE_RESTARTED, *UNREACHED),
    K.BUS_OFF: (K.BUS_PASSIVE, K.BUS_REFUSES, K.BUS_WARNING, K.FRAMES_LOST, *SIGNALS, *UNREACHED),
    K.BUS_PASSIVE: (K.BUS_REFUSES, K.BUS_WARNING, *SIGNALS, *UNREACHED),
    K.BUS_REFUSES: (K.BUS_WARNING, *SIGNALS, *UNREACHED),
    K.BUS_WARNING: SIGNALS,
    K.DUPLICATE_NODE_ID: (K.ENCODER_JUMP, K.JOINT_POSITION, K.JOINT_VELOCITY, *SIGNALS, *UNREACHED),
    K.DRIVE_RESTARTED: (*SIGNALS, *UNREACHED),
    K.FOREIGN_COMMANDS: (*UNREACHED, K.JOINT_POSITION, K.JOINT_VELOCITY),
    K.DRIVE_SILENT: (*SIGNALS[1:], *UNREACHED),
    K.DRIVE_QUIET: (K.POSITION_STALE, K.CURRENT_STALE, K.DRIVE_LATE),
    K.POSITION_SILENT: (K.POSITION_STALE, K.DRIVE_LATE),
    K.CURRENT_SILENT: (K.CURRENT_STALE, K.DRIVE_LATE),
    K.POSITION_STALE: (K.DRIVE_LATE,),
    K.CURRENT_STALE: (K.DRIVE_LATE,),
    K.DRIVE_ERROR: POWERLESS,
    K.SETPOINT_MISMATCH: POWERLESS,
    K.DRIVE_DISARMED: POWERLESS[1:],
    K.ENCODER_JUMP: (K.JOINT_POSITION, K.JOINT_VELOCITY),
    K.MOTOR_HOT: (K.MOTOR_OVERHEATING, K.WINDING_HOT, K.WINDING_OVERHEATING),
    K.WINDING_HOT: (K.MOTOR_OVERHEATING, K.WINDING_OVERHEATING),
    K.FLIPPER_STUCK: (K.JOINT_NOT_FOLLOWING,),
    K.RECORDER_DEAD: (K.ROWS_LOST,),
    K.DISK_LOW: (K.LOG_UNWRITABLE, K.ROWS_LOST, K.DISK_SLOW),
    K.LOG_UNWRITABLE: (K.ROWS_LOST,),
    K.DISK_SLOW: (K.ROWS_LOST,),
}
CAUSES_OF = {
    kind: tuple(cause for cause, consequences in CONSEQUENCES.items() if kind in consequences) for kind in FaultKind
}
SCOPES = {"drive": "joint", "watchdog": "joint", "joint": "joint", "flipper": "flipper", "bus": "bus"}  # else the robot


class AgedFault(NamedTuple):
    fault: Fault
    age_s: float  # since it was first detected


def is_settling(fault: Fault, heard_s: float) -> bool:
    """Return whether a drive may still answer, `heard_s` after the first time at which all of them were heard.

    What is settling blocks arming, and is no cause in the status nor logged.
    """
    return fault.kind in ASKED and heard_s < ANSWERED_S


class Cause(NamedTuple):
    """One cause: the fault, the same fault of other parts, and what follows from them."""

    faults: tuple[AgedFault, ...]
    consequences: tuple[AgedFault, ...]

    @property
    def root(self) -> Fault:
        return self.faults[0].fault

    @property
    def age_s(self) -> float:
        return max(each.age_s for each in self.faults)

    @property
    def reaction(self) -> Reaction:
        """The hardest reaction to any of its faults."""
        return max(each.fault.kind.reaction for each in (*self.faults, *self.consequences))

    def includes(self, fault: Fault) -> bool:
        """Return whether this fault, perhaps with other values, is the cause or follows from it."""
        present = (each.fault for each in (*self.faults, *self.consequences))
        return any((each.kind, each.subject) == (fault.kind, fault.subject) for each in present)

    @property
    def blocks_arming(self) -> bool:
        return any(each.fault.kind.blocks is not Blocks.NO for each in (*self.faults, *self.consequences))


def group_by_cause(faults: Sequence[AgedFault], bus_of: Mapping[str, str]) -> list[Cause]:
    """Return the causes of these faults, the most severe first; `bus_of` names the bus of each joint."""
    present = {(each.fault.kind, each.fault.subject): each for each in faults}
    groups: dict[tuple[object, ...], tuple[list[AgedFault], list[AgedFault]]] = {}
    for each in faults:
        root = _root(each, present, bus_of)
        groups.setdefault(_sort(root.fault), ([], []))[root is not each].append(each)
    causes = [Cause(tuple(roots), tuple(consequences)) for roots, consequences in groups.values()]
    return sorted(causes, key=lambda cause: -cause.reaction)


def _sort(fault: Fault) -> tuple[object, ...]:
    """Faults of one kind have one cause, unless the drives or the computer give different reasons."""
    values = dict(fault.values)
    return fault.kind, values.get("reason"), values.get("flags")


def _root(each: AgedFault, present: Mapping[tuple[FaultKind, str], AgedFault], bus_of: Mapping[str, str]) -> AgedFault:
    """Return the fault from which this one follows in the end: itself if it follows from none."""
    subject = each.fault.subject
    subjects = {
        "joint": subject,
        "flipper": subject.partition("_")[0],
        "bus": bus_of.get(subject, subject),
        "robot": "",
    }
    for kind in CAUSES_OF[each.fault.kind]:
        cause = present.get((kind, subjects[SCOPES.get(kind.part, "robot")]))
        before_s = RESTART_S if kind is K.DRIVE_RESTARTED else BEFORE_S
        if cause and each.age_s <= cause.age_s + before_s:
            return _root(cause, present, bus_of)
    return each
