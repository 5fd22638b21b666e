"""A cause of several faults is reported in one sentence."""

from __future__ import annotations

from control.fault_causes import AgedFault, group_by_cause
from control.faults import Fault, FaultKind
from control.records import JOINTS
from firmware_host.operator.reports import cause_report

BUS_OF = {joint: joint.partition("_")[0] for joint in JOINTS}
SILENT = [
    FaultKind.DRIVE_SILENT.fault(joint, age_s=age_s)
    for joint, age_s in zip(JOINTS, (1.63, 1.75, 2.0, 2.5), strict=True)
]
SILENT_TEXTS = [f"drive_silent {joint}" for joint in JOINTS]


def report_of(*faults: Fault) -> dict[str, object]:
    (cause,) = group_by_cause([AgedFault(fault, 1.0) for fault in faults], BUS_OF)
    return cause_report(cause)


def test_a_dead_bus_says_since_when_no_frame_came() -> None:
    report = report_of(FaultKind.BUS_OFF.fault("left"), *SILENT[:2])
    message = str(report["message"])
    assert "left" in message and "1.6 s" in message and message.count(".") == 2  # one sentence and a decimal point
    assert report["consequences"] == SILENT_TEXTS[:2] and report["reaction"] == "drives_idle"


def test_further_parts_with_the_same_fault_are_named() -> None:
    report = report_of(*SILENT)
    assert report["subjects"] == list(JOINTS) and all(joint in str(report["message"]) for joint in JOINTS)
    assert report["consequences"] == []
