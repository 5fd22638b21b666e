"""The order of phases: what begins a stride, what closes one, and what never does."""

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.records import Phase
from estimation.stride_clock import BORDERS, STROKES, Change, StrideClock

REST, INSERTION, STANCE = Phase.REST, Phase.INSERTION, Phase.STANCE
EXTRACTION, SWING, PAUSE = Phase.EXTRACTION, Phase.SWING, Phase.PAUSE


def changes(phases: Iterable[Phase], clock: StrideClock | None = None, period_s: float = 1.0) -> list[Change]:
    """Drive the clock as an estimator does: ask it at changes only, and begin a stride where it says so."""
    clock, seen = clock or StrideClock(), list[Change]()
    for tick, phase in enumerate(phases, 1):
        if phase is clock.phase:
            continue
        change = clock.change(tick * period_s, phase)
        if change.begins_stride:
            clock.begin(tick * period_s)
        seen.append(change)
    return seen


@pytest.mark.parametrize("border", [SWING, INSERTION])
def test_insertion_stance_and_extraction_close_with_the_phase_after(border: Phase) -> None:
    *before, last = changes([INSERTION, STANCE, EXTRACTION, border])
    assert last == Change(EXTRACTION, True, True)
    assert not any(change.closes_stride for change in before)


def test_pauses_between_the_strokes_change_nothing() -> None:
    seen = changes([INSERTION, PAUSE, STANCE, PAUSE, EXTRACTION, PAUSE, SWING])
    assert [change.closes_stride for change in seen] == [False] * 6 + [True]
    assert [change.begins_stride for change in seen] == [True] + [False] * 5 + [True]


@pytest.mark.parametrize("before", [[EXTRACTION], [EXTRACTION, PAUSE]])
def test_a_stride_with_a_recovery_closes_with_the_swing_after_it(before: list[Phase]) -> None:
    seen = changes([INSERTION, STANCE, *before, Phase.RECOVERY, SWING, INSERTION])
    assert [change.closes_stride for change in seen[-3:]] == [False, True, False]
    assert seen[-3].begins_stride is False


@pytest.mark.parametrize("strokes", [1, 2, 3, 4])
def test_a_stride_that_rest_cuts_short_does_not_close(strokes: int) -> None:
    begun = [INSERTION, STANCE, EXTRACTION, Phase.RECOVERY][:strokes]
    assert not any(change.closes_stride for change in changes([*begun, REST, SWING, INSERTION]))


def test_durations_are_from_change_to_change() -> None:
    clock = StrideClock()
    for now_s, phase in ((1.0, INSERTION), (1.4, STANCE), (1.5, PAUSE), (1.7, EXTRACTION)):
        if clock.change(now_s, phase).begins_stride:
            clock.begin(now_s)
    assert clock.start_s == 1.0
    clock.change(2.0, SWING)
    assert clock.duration_s == pytest.approx({INSERTION: 0.4, STANCE: 0.1, EXTRACTION: 0.3})


@pytest.mark.parametrize("period_s", [0.0, -1.0])
def test_a_clock_that_stands_still_or_runs_backward_closes_nothing(period_s: float) -> None:
    assert not any(change.closes_stride for change in changes([INSERTION, STANCE, EXTRACTION, SWING], None, period_s))


def test_a_reset_forgets_the_stride_under_way_and_the_count() -> None:
    clock = StrideClock()
    changes([INSERTION, STANCE, EXTRACTION], clock)
    clock.index = 7
    clock.reset()
    assert (clock.index, clock.phase) == (0, REST)
    assert not clock.change(9.0, SWING).closes_stride


@given(st.lists(st.sampled_from(Phase), max_size=60))
def test_a_stride_closes_only_after_all_its_strokes_and_never_into_rest(phases: list[Phase]) -> None:
    since: set[Phase] = set()
    before = REST
    for change, phase in zip(changes(phases), _distinct(phases), strict=True):
        since.add(change.ended)
        assert change.ended is before
        assert change.begins_stride == (phase in BORDERS)
        assert not change.closes_stride or (since >= set(STROKES) and phase is not REST)
        if change.begins_stride:
            since.clear()
        before = phase


def _distinct(phases: list[Phase]) -> list[Phase]:
    """Return each phase that differs from the one before, the first compared with rest."""
    return [phase for before, phase in zip([REST, *phases], phases, strict=False) if phase is not before]
