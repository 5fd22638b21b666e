"""Faults of one cause are one group, so that each cause is reported once."""

from graphlib import TopologicalSorter

import pytest

from control.fault_causes import CONSEQUENCES, AgedFault, group_by_cause
from control.faults import Fault, FaultKind, Reaction
from control.records import JOINTS

BUS_OF = {joint: joint.partition("_")[0] for joint in JOINTS}
K = FaultKind


def causes(*faults: Fault, age_s: float = 1.0) -> list[tuple[FaultKind, list[str], int]]:
    """Return the kind, the subjects and the number of consequences of each cause."""
    grouped = group_by_cause([AgedFault(fault, age_s) for fault in faults], BUS_OF)
    return [
        (cause.root.kind, [each.fault.subject for each in cause.faults], len(cause.consequences)) for cause in grouped
    ]


def dead_bus(name: str) -> list[Fault]:
    joints = [joint for joint in JOINTS if BUS_OF[joint] == name]
    kinds = (K.DRIVE_LATE, K.DRIVE_QUIET, K.DRIVE_SILENT, K.HEARTBEAT_SILENT, K.DRIVE_ERROR)
    signals = [kind.fault(joint, age_s=1.63, signal="position", flags="1") for joint in joints for kind in kinds]
    return [*signals, K.BUS_REFUSES.fault(name), K.BUS_OFF.fault(name)]


def test_a_dead_bus_is_one_cause_with_everything_that_its_drives_report() -> None:
    assert causes(*dead_bus("left")) == [(K.BUS_OFF, ["left"], 11)]


@pytest.mark.parametrize("loop", [K.LOOP_LAGGING, K.LOOP_CRAWLING, K.LOOP_STALLED])
def test_drives_that_a_late_loop_did_not_ask_follow_from_it(loop: FaultKind) -> None:
    unasked = [kind.fault(joint) for joint in JOINTS for kind in (K.DRIVE_LATE, K.DRIVE_QUIET, K.DRIVE_SILENT)]
    assert causes(*unasked, loop.fault()) == [(loop, [""], 12)]


def test_two_dead_buses_are_one_cause() -> None:
    assert causes(*dead_bus("left"), *dead_bus("right")) == [(K.BUS_OFF, ["left", "right"], 22)]


def test_a_fault_of_the_other_bus_is_a_cause_of_its_own() -> None:
    found = causes(K.BUS_WARNING.fault("left"), K.DRIVE_SILENT.fault("right_sweep"))
    assert found == [(K.DRIVE_SILENT, ["right_sweep"], 0), (K.BUS_WARNING, ["left"], 0)]


def test_a_fault_that_was_there_long_before_does_not_follow() -> None:
    faults = [AgedFault(K.DRIVE_ERROR.fault("left_sweep"), 60.0), AgedFault(K.BUS_OFF.fault("left"), 1.0)]
    assert len(group_by_cause(faults, BUS_OF)) == 2


def test_torque_that_was_missing_before_a_drive_had_booted_follows_from_its_restart() -> None:
    missing, restarted = K.TORQUE_MISSING.fault("left_sweep"), K.DRIVE_RESTARTED.fault("left_sweep")
    (cause,) = group_by_cause([AgedFault(missing, 3.0), AgedFault(restarted, 1.0)], BUS_OF)
    assert cause.root.kind is K.DRIVE_RESTARTED


def test_drives_with_different_errors_are_different_causes() -> None:
    same = [K.DRIVE_ERROR.fault(joint, reason="watchdog expired") for joint in JOINTS[:3]]
    other = K.DRIVE_ERROR.fault(JOINTS[3], reason="too hot")
    assert causes(*same, other) == [(K.DRIVE_ERROR, list(JOINTS[:3]), 0), (K.DRIVE_ERROR, [JOINTS[3]], 0)]


def test_the_worst_reaction_of_a_consequence_is_that_of_its_cause() -> None:
    faults = [AgedFault(fault, 1.0) for fault in (K.BUS_WARNING.fault("left"), K.DRIVE_SILENT.fault("left_sweep"))]
    (cause,) = group_by_cause(faults, BUS_OF)
    assert cause.root.kind is K.BUS_WARNING and cause.reaction is Reaction.DRIVES_IDLE and cause.blocks_arming


@pytest.mark.parametrize("kind", FaultKind)
def test_every_fault_alone_is_its_own_cause(kind: FaultKind) -> None:
    assert causes(kind.fault("left_sweep")) == [(kind, ["left_sweep"], 0)]


def test_no_fault_is_lost_or_counted_twice() -> None:
    faults = [kind.fault(joint) for kind in FaultKind for joint in (*JOINTS, "left", "right", "")]
    grouped = group_by_cause([AgedFault(fault, 1.0) for fault in faults], BUS_OF)
    found = [each.fault for cause in grouped for each in (*cause.faults, *cause.consequences)]
    assert sorted(found) == sorted(faults)


def test_nothing_follows_from_itself() -> None:
    TopologicalSorter(CONSEQUENCES).prepare()
