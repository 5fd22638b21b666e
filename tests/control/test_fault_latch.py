"""When faults begin, stand and end, and which of them counts."""

import pytest

from control.fault_latch import FaultLatch
from control.faults import FAULT_KINDS, Fault, Reaction


def fault_of(name: str, subject: str = "left_sweep") -> Fault:
    return FAULT_KINDS[name].fault(subject)


LATE, STALE, HOT = fault_of("drive_late"), fault_of("current_stale"), fault_of("motor_overheating", "right_sweep")
QUIET, SILENT, BUG = fault_of("drive_quiet"), fault_of("drive_silent"), fault_of("torque_not_finite", "")
DISK, SILENT_TOO = fault_of("disk_low", ""), fault_of("drive_silent", "right_sweep")


def ticks_standing(fault: Fault, energised: bool, energised_after: bool) -> int:
    """Return for how many ticks a fault stands after the tick in which it was present; 1001 means for ever."""
    latch = FaultLatch()
    latch.update([fault], energised)
    for tick in range(1, 1001):
        latch.update([], energised_after)
        if not latch.present:
            return tick
    return 1001


def test_a_fault_is_as_old_as_its_first_tick_and_one_that_came_back_is_young() -> None:
    latch = FaultLatch()
    for _ in range(10):
        latch.update([LATE], False)
    latch.update([], False, ticks=5)
    assert latch.age_ticks(LATE) == 14
    latch.update([], False, ticks=GOOD_TICKS)
    latch.update([LATE], False)
    assert latch.age_ticks(LATE) == 0


GOOD_TICKS = 50
FOR_EVER, A_WHILE = 1001, GOOD_TICKS + 1


@pytest.mark.parametrize(
    ("fault", "energised", "energised_after", "expected"),
    [
        *((fault, False, False, A_WHILE) for fault in (LATE, HOT, QUIET, SILENT, BUG)),  # where torque was off
        (LATE, True, True, A_WHILE),  # a warning
        (STALE, True, True, A_WHILE),  # it only holds
        (HOT, True, True, FOR_EVER),  # a soft stop goes to its end
        (QUIET, True, True, FOR_EVER),
        (HOT, True, False, A_WHILE),
        (QUIET, True, False, A_WHILE),
        *((fault, True, after, FOR_EVER) for fault in (SILENT, BUG) for after in (False, True)),
    ],
)
def test_a_fault_ends_with_its_cause_and_where_torque_was_on_by_its_kind(
    fault: Fault, energised: bool, energised_after: bool, expected: int
) -> None:
    assert ticks_standing(fault, energised, energised_after) == expected


def test_the_message_is_that_of_the_last_time_and_the_event_that_of_the_first() -> None:
    latch = FaultLatch()
    latch.update([LATE], False)
    assert latch.begun == [LATE]
    later = LATE.with_values(age_s=0.009)
    latch.update([later], False)
    assert (latch.begun, latch.present) == ([], [later])


def test_the_worst_is_the_hardest_and_of_equals_the_first() -> None:
    latch = FaultLatch()
    latch.update([], True)
    assert (latch.worst, latch.reaction, latch.blocking()) == (None, Reaction.NONE, [])
    for faults, worst in (
        ([LATE], LATE),
        ([HOT], HOT),
        ([QUIET, SILENT], SILENT),
        ([SILENT_TOO], SILENT),
    ):
        latch.update(faults, True)
        assert (latch.worst, latch.reaction) == (worst, worst.kind.reaction)


def test_force_overrules_what_may_be_overruled() -> None:
    latch = FaultLatch()
    latch.update([LATE, DISK, HOT], False)
    assert latch.blocking() == [DISK, HOT]
    assert latch.blocking(forced=DISK.name) == [HOT] == latch.blocking(forced=f"uncalibrated,{DISK.name}")
    assert latch.blocking(forced="watchdog_unknown") == [DISK, HOT] == latch.blocking(forced=HOT.name)


@pytest.mark.parametrize(("fault", "ends"), [(HOT, True), (SILENT, True), (BUG, False)])
def test_a_clear_ends_at_once_what_latched_unless_its_cause_is_there_or_it_is_a_bug(fault: Fault, ends: bool) -> None:
    latch = FaultLatch()
    latch.update([fault], True)
    latch.update([fault], True, clearing=True)
    assert (latch.present, latch.over) == ([fault], [])
    latch.update([], True, clearing=True)
    assert (latch.present, latch.over) == (([], [fault]) if ends else ([fault], []))


def test_a_reset_forgets_everything_even_a_bug() -> None:
    latch = FaultLatch()
    latch.update([BUG], True)
    latch.reset()
    latch.update([], True)
    assert (latch.present, latch.worst, latch.begun, latch.over) == ([], None, [], [])
