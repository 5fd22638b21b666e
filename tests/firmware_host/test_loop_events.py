"""The events of the loop: messages in the log, and the notice in the status."""

from typing import Any

import pytest

from control.faults import Fault, FaultKind
from control.modes import Mode
from firmware_host.loop_events import LoopEvents
from tests.recorded_events import EventRecorder

Change = dict[str, Any]
FAULT = FaultKind.LEASE_LOST.fault(holder="Anna")
JOINT = "left_sweep"
MISSING = FaultKind.TORQUE_MISSING.fault(JOINT)
RESTARTED, HOT = FaultKind.DRIVE_RESTARTED.fault(JOINT), FaultKind.MOTOR_HOT.fault("right_sweep", temperature_c=95.0)
UNKNOWN = FaultKind.WATCHDOG_UNKNOWN.fault(JOINT)


@pytest.fixture
def recorder() -> EventRecorder:
    return EventRecorder()


@pytest.fixture
def events(recorder: EventRecorder) -> LoopEvents:
    return LoopEvents(recorder, longest_hold_s=60.0, bus_of={JOINT: "left"})


def change(before: Mode, after: Mode, faulty: bool = False, rested: bool = False, up: bool = True) -> Change:
    return {"before": before, "after": after, "fault": FAULT if faulty else None, "rested": rested, "flippers_up": up}


def test_a_change_of_mode_is_logged_with_its_cause(events: LoopEvents, recorder: EventRecorder) -> None:
    events.report_mode_change(1.0, **change(Mode.WALKING, Mode.STOPPING, faulty=True))
    assert recorder.texts == ["mode walking to stopping: Anna held the lease, and disconnected or did not renew it."]
    assert events.notice.startswith(
        "stopped by lease_lost: Anna held the lease, and disconnected or did not renew it. "
    )


@pytest.mark.parametrize("mode", [Mode.ARMING, Mode.WALKING])
def test_a_notice_stays_until_the_robot_is_moved_again(events: LoopEvents, mode: Mode) -> None:
    events.report_end_of_move(1.0, "stop was asked for.")
    events.report_mode_change(2.0, **change(Mode.HOLD, Mode.IDLE))
    assert events.notice == "the joints stopped on their way: stop was asked for."
    events.report_mode_change(3.0, **change(Mode.IDLE, mode))
    assert events.notice == ""


@pytest.mark.parametrize(
    ("changed", "notice"),
    [
        (change(Mode.HOLD, Mode.IDLE, rested=True), "the pose was held for 60 s without a request"),
        (change(Mode.STOPPING, Mode.HOLD, up=False), "the flippers did not come out of the mud"),
    ],
)
def test_a_notice_is_also_in_the_log(events: LoopEvents, recorder: EventRecorder, changed: Change, notice: str) -> None:
    events.report_mode_change(1.0, **changed)
    assert events.notice.startswith(notice)
    assert recorder.texts[1:] == [events.notice]


@pytest.mark.parametrize(
    "changed", [change(Mode.HOLD, Mode.IDLE), change(Mode.STOPPING, Mode.HOLD), change(Mode.BOOT, Mode.IDLE, True)]
)
def test_usual_changes_and_faults_without_torque_leave_no_notice(events: LoopEvents, changed: Change) -> None:
    events.report_mode_change(1.0, **changed)
    assert events.notice == ""


@pytest.mark.parametrize(
    ("later", "elapsed_s", "named"),
    [(RESTARTED, 1.4, "drive_restarted"), (RESTARTED, 60.0, "torque_missing"), (HOT, 1.4, "torque_missing")],
    ids=["its cause", "long after", "unrelated"],
)
def test_the_notice_names_the_first_cause_of_the_stop_and_its_time(
    events: LoopEvents, later: Fault, elapsed_s: float, named: str
) -> None:
    events.report_mode_change(1.0, **change(Mode.WALKING, Mode.STOPPING) | {"fault": MISSING})
    events.report_mode_change(1.2, **change(Mode.STOPPING, Mode.DAMPING, faulty=True))
    events.report_faults(1.0 + elapsed_s, [later], [])
    assert events.notice.startswith(f"stopped by {named}: ") and events.notice_s == 1.0


def test_settings_that_a_drive_reports_soon_after_its_start_were_no_fault(
    events: LoopEvents, recorder: EventRecorder
) -> None:
    events.report_faults(9.0, [], [])  # the drives' supply is switched on some time after the daemon
    events.report_faults(10.0, [UNKNOWN], [])
    events.report_mode_change(10.0, **change(Mode.BOOT, Mode.IDLE))
    assert events.is_settling(UNKNOWN)
    events.report_faults(11.0, [], [UNKNOWN])
    assert recorder.texts[1:] == [] and not events.is_settling(UNKNOWN)
    events.report_faults(11.5, [UNKNOWN], [])
    events.report_faults(12.1, [], [])
    assert not events.is_settling(UNKNOWN)
    events.report_faults(12.2, [], [UNKNOWN])
    assert [text.split()[1] for text in recorder.texts[1:]] == ["watchdog_unknown", "watchdog_unknown"]


def test_settings_that_are_lost_later_are_a_fault_at_once(events: LoopEvents, recorder: EventRecorder) -> None:
    events.report_mode_change(1.0, **change(Mode.BOOT, Mode.IDLE))
    events.report_faults(10.0, [RESTARTED, UNKNOWN], [])
    assert not events.is_settling(UNKNOWN)
    assert [text.split()[1] for text in recorder.texts[1:]] == ["drive_restarted", "watchdog_unknown"]
