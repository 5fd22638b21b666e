"""On a synthetic clock, the ticker keeps its absolute deadlines."""

import pytest

from control.rate import PERIOD_S, RATE_HZ
from firmware_host.ticker import Ticker
from tests.firmware_host.synthetic_clock import SyntheticClock


def make_ticker(clock: SyntheticClock) -> Ticker:
    return Ticker(PERIOD_S, clock.read, clock.sleep)


def test_the_rate_does_not_drift_with_the_work() -> None:
    clock = SyntheticClock(oversleep_s=50e-6)
    ticker = make_ticker(clock)
    for _ in range(38000):
        ticker.wait()
        clock.now_s += 0.7 * PERIOD_S
    assert (clock.now_s - 0.7 * PERIOD_S - 100.0) * RATE_HZ == pytest.approx(38000, abs=0.03)


def test_deadlines_that_were_missed_are_skipped_and_counted() -> None:
    clock = SyntheticClock()
    ticker = make_ticker(clock)
    ticker.wait()
    clock.now_s += 3.4 * PERIOD_S
    tick = ticker.wait()
    assert (tick.missed, tick.number) == (2, 4)
    assert tick.late_s == pytest.approx(2.4 * PERIOD_S)


def test_a_sleep_that_ends_early_is_continued() -> None:
    clock = SyntheticClock(oversleep_s=-1e-4)
    tick = make_ticker(clock).wait()
    assert tick.late_s >= 0.0
    assert len(clock.slept_s) > 1
