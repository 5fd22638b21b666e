"""Stamps of lines that come in bursts are as even as the measurements were."""

from itertools import pairwise

import pytest

from drivers.load_cell.sample_clock import LineClock

PERIOD_S = 0.0125


def hear(clock: LineClock, begin_s: float, lines: int, burst_s: float) -> list[float]:
    """Return all stamps of lines that an adapter delivers every `burst_s`."""
    stamps_s, waiting, handed_s = list[float](), 0, begin_s
    for line in range(lines):
        waiting += 1
        at_s = begin_s + line * PERIOD_S
        if at_s >= handed_s + burst_s:
            stamps_s += clock.stamps_s(waiting, at_s)
            waiting, handed_s = 0, at_s
    return stamps_s


@pytest.mark.parametrize("burst_s", [0.0, 0.016, 0.05])
def test_stamps_are_even_however_the_lines_are_bundled(burst_s: float) -> None:
    clock = LineClock(115200)
    stamps_s = hear(clock, 0.0, 800, burst_s)[400:]
    assert clock.period_s == pytest.approx(PERIOD_S, rel=0.01)
    steps_s = [after - before for before, after in pairwise(stamps_s)]
    assert all(step_s == pytest.approx(PERIOD_S, abs=0.002) for step_s in steps_s)
    assert clock.drop_outs == 0


def test_a_gap_stays_a_gap_and_is_counted() -> None:
    clock = LineClock(115200)
    before_s = hear(clock, 0.0, 200, 0.0)[-1]
    after_s = hear(clock, 3.0, 50, 0.0)[0]
    assert clock.drop_outs == 1
    assert after_s - before_s == pytest.approx(0.5, abs=0.02)
    assert clock.period_s == pytest.approx(PERIOD_S, rel=0.01)


def test_lines_that_a_busy_computer_delivered_late_do_not_falsify_the_period() -> None:
    """After 200 ms without a line one line comes, then all others at once; this may happen at any time."""
    for stalled in (6, 20, 300):
        clock, stamps_s = LineClock(115200), list[float]()
        for line in range(800):
            at_s = line * PERIOD_S
            if stalled <= line < stalled + 16:
                continue
            if line == stalled + 16:
                stamps_s += clock.stamps_s(1, at_s)
                stamps_s += clock.stamps_s(16, at_s + 0.001)
            else:
                stamps_s += clock.stamps_s(1, at_s)
        steps_s = [after - before for before, after in pairwise(stamps_s[600:])]
        assert clock.drop_outs <= 3
        assert all(step_s == pytest.approx(PERIOD_S, abs=0.001) for step_s in steps_s)


def test_no_stamp_lies_in_the_future_or_before_the_last() -> None:
    clock = LineClock(9600)
    last_s = -1.0
    for read, now_s in enumerate([0.0, 0.001, 0.05, 0.05, 0.3, 0.3, 0.31, 0.32, 0.33, 0.4, 0.5, 0.5] * 3):
        now_s += read // 12
        for stamp_s in clock.stamps_s(1 + read % 4, now_s):
            assert last_s < stamp_s <= now_s + 1e-4
            last_s = stamp_s


def test_a_reset_clock_knows_no_period() -> None:
    clock = LineClock(9600)
    hear(clock, 0.0, 100, 0.0)
    clock.reset()
    assert clock.period_s is None
    assert clock.stamps_s(1, 100.0) == [100.0]
