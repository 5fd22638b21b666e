"""A ticker that stalls and a wall clock that steps, on a synthetic clock."""

from __future__ import annotations

import pytest

from control.rate import PERIOD_S
from drivers.fault_injection.failures import Failures
from firmware_host.fault_injection.failing_time import (
    CLOCK_STEP_S,
    SLOW_TICK_S,
    STALL_S,
    FailingClock,
    FailingTicker,
    failing_clock,
    failing_ticker,
)
from firmware_host.ticker import Tick, Ticker


class SyntheticClock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def read(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s


class Bench:
    def __init__(self) -> None:
        self.clock, self.failures = SyntheticClock(), Failures(())
        self.reported: list[tuple[float, str]] = []
        ticker = Ticker(PERIOD_S, self.clock.read, self.clock.sleep)
        report = lambda now_s, text: self.reported.append((now_s, text))  # noqa: E731
        self.ticker = FailingTicker(ticker, self.failures, report, self.clock.sleep)

    def wait(self, ticks: int) -> list[Tick]:
        return [self.ticker.wait() for _ in range(ticks)]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_without_a_failure_no_tick_is_missed(bench: Bench) -> None:
    assert all(tick.missed == 0 and tick.late_s < 1e-9 for tick in bench.wait(100))


def test_a_stuck_loop_stalls_once(bench: Bench) -> None:
    bench.wait(10)
    bench.failures.begin("loop", "stuck", bench.clock.now_s, 1.0)
    first, *others = bench.wait(100)
    assert (first.missed + 1) * PERIOD_S <= STALL_S < (first.missed + 2) * PERIOD_S
    assert all(tick.missed == 0 for tick in others)


def test_a_loop_can_be_stuck_twice(bench: Bench) -> None:
    for _ in range(2):
        bench.failures.begin("loop", "stuck", bench.clock.now_s, 1.0)
        assert [tick.missed > 0 for tick in bench.wait(5)] == [True, False, False, False, False]


def test_a_slow_loop_lags_until_its_time_is_over(bench: Bench) -> None:
    bench.wait(10)
    begin_s = bench.clock.now_s
    bench.failures.begin("loop", "slow", begin_s, 1.0)
    slow = [tick for tick in bench.wait(300) if tick.now_s < begin_s + 1.0]
    mean_s = (slow[-1].now_s - begin_s) / len(slow)
    assert SLOW_TICK_S <= mean_s < 2.0 * PERIOD_S
    assert all(tick.missed == 0 for tick in bench.wait(100))


def test_the_end_of_a_failure_is_reported_in_its_tick(bench: Bench) -> None:
    bench.failures.begin("pose", "off", bench.clock.now_s, 0.02)
    bench.wait(20)
    ((now_s, text),) = bench.reported
    assert text == "end of failing on purpose: pose off"
    assert 100.02 <= now_s < 100.02 + PERIOD_S


def test_a_stuck_clock_continues_afterwards() -> None:
    wall, failures = SyntheticClock(), Failures(())
    clock = FailingClock(wall.read, failures)
    assert clock() == 100.0
    failures.begin("clock", "stuck", 0.0, 1.0)
    seen = []
    for _ in range(3):
        wall.sleep(1.0)
        seen.append(clock())
    failures.end_all()
    assert seen == [101.0] * 3 and clock() == 103.0


def test_a_clock_steps_by_an_hour_and_back() -> None:
    wall, failures = SyntheticClock(), Failures(())
    clock = FailingClock(wall.read, failures)
    failures.begin("clock", "garbage", 0.0, 1.0)
    assert clock() == 100.0 + CLOCK_STEP_S
    failures.end_all()
    assert clock() == 100.0


def test_time_that_may_not_fail_is_not_wrapped() -> None:
    ticker, clock = Ticker(), SyntheticClock().read
    assert failing_ticker(ticker, None, lambda now_s, text: None) is ticker
    assert failing_clock(clock, None) is clock
