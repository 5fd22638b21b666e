"""When faults begin, stand and end: single claims, and a model that gets the same input and must always agree."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from control.fault_latch import GOOD_S, FaultLatch
from control.faults import FAULT_KINDS, Blocks, Clears, Fault, Reaction
from control.rate import PERIOD_S


def fault_of(name: str, subject: str = "left_sweep") -> Fault:
    return FAULT_KINDS[name].fault(subject)


LATE, STALE, HOT = fault_of("drive_late"), fault_of("current_stale"), fault_of("motor_overheating", "right_sweep")
QUIET, SILENT, BUG = fault_of("drive_quiet"), fault_of("drive_silent"), fault_of("torque_not_finite", "")
DISK = fault_of("disk_low", "")
ALL = [LATE, STALE, HOT, QUIET, SILENT, BUG, DISK, fault_of("drive_silent", "right_sweep")]


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


GOOD_TICKS = round(GOOD_S / PERIOD_S)
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
    later = LATE.with_values(age_s=0.009)
    latch.update([later], False)
    assert (latch.begun, latch.present) == ([], [later])


def test_the_worst_is_the_hardest_and_of_equals_the_first() -> None:
    latch = FaultLatch()
    latch.update([], True)
    assert (latch.worst, latch.reaction, latch.blocking()) == (None, Reaction.NONE, [])
    for faults, worst in (([LATE], LATE), ([HOT], HOT), ([QUIET, SILENT], SILENT), ([ALL[-1]], SILENT)):
        latch.update(faults, True)
        assert latch.worst == worst


def test_force_overrules_what_may_be_overruled() -> None:
    latch = FaultLatch()
    latch.update([LATE, DISK, HOT], False)
    assert latch.blocking() == [DISK, HOT]
    assert latch.blocking(forced=DISK.name) == [HOT] == latch.blocking(forced=f"uncalibrated,{DISK.name}")
    assert latch.blocking(forced="watchdog_unknown") == [DISK, HOT] == latch.blocking(forced=HOT.name)


def test_a_reset_forgets_everything_even_a_bug() -> None:
    latch = FaultLatch()
    latch.update([BUG], True)
    latch.reset()
    latch.update([], True)
    assert (latch.present, latch.worst, latch.begun, latch.over) == ([], None, [], [])


class Oracle(RuleBasedStateMachine):
    """A model that stores the history of each fault and evaluates it again in every tick, by the text of the page of
    faults.
    """

    def __init__(self) -> None:
        super().__init__()
        self.latch = FaultLatch()
        self.now = 0
        self.last_seen: dict[Fault, int] = {}  # of those that stand
        self.met_torque: set[Fault] = set()
        self.events: dict[Fault, int] = dict.fromkeys(ALL, 0)  # begun minus over

    @rule(
        present=st.lists(st.sampled_from(ALL), unique=True, max_size=4),
        energised=st.booleans(),
        clearing=st.booleans(),
        ticks=st.sampled_from([1, 1, 2, 40]),
        times=st.sampled_from([1, 1, 30]),
    )
    def tick(self, present: list[Fault], energised: bool, clearing: bool, ticks: int, times: int) -> None:
        for _ in range(times):
            self.once(present, energised, clearing, ticks)

    def once(self, present: list[Fault], energised: bool, clearing: bool, ticks: int) -> None:
        self.now += ticks
        self.latch.update(present, energised, clearing, ticks)
        begun = [fault for fault in present if fault not in self.last_seen]
        for fault in present:
            self.last_seen[fault] = self.now
            if energised:
                self.met_torque.add(fault)
        over = [fault for fault in self.last_seen if fault not in present and self.ends(fault, energised, clearing)]
        for fault in over:
            del self.last_seen[fault]
            self.met_torque.discard(fault)
        assert sorted(self.latch.begun) == sorted(begun)
        assert sorted(self.latch.over) == sorted(over)
        for fault in self.latch.begun:
            self.events[fault] += 1
        for fault in self.latch.over:
            self.events[fault] -= 1

    def ends(self, fault: Fault, energised: bool, clearing: bool) -> bool:
        gone_for_a_while = self.now - self.last_seen[fault] > 50
        if fault not in self.met_torque:
            return gone_for_a_while
        by_itself = {
            Clears.WHEN_GONE: gone_for_a_while and not (energised and fault.kind.reaction >= Reaction.SOFT_STOP),
            Clears.BY_HAND: False,
            Clears.BY_RESTART: False,
        }[fault.kind.clears]
        return by_itself or (clearing and fault.kind.clears is not Clears.BY_RESTART)

    @invariant()
    def they_agree(self) -> None:
        standing = set(self.last_seen)
        assert set(self.latch.present) == standing
        assert self.latch.reaction == max((fault.kind.reaction for fault in standing), default=Reaction.NONE)
        assert set(self.latch.blocking()) == {fault for fault in standing if fault.kind.blocks is not Blocks.NO}
        assert self.events == {fault: int(fault in standing) for fault in ALL}


TestAgainstAModel = Oracle.TestCase
TestAgainstAModel.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
