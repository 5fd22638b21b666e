"""A ticker that stalls and a wall clock that steps, both on purpose.

The stall comes after a tick's work and before the wait for the next deadline, as if the work took too long.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from drivers.fault_injection.failures import Failure, FailureKind, Failures, end_text
from firmware_host.ticker import Tick

STALL_S = 0.03  # eleven ticks: longer than a drive may be silent
SLOW_TICK_S = 0.004  # one and a half ticks
CLOCK_STEP_S = 3600.0


class TickSource(Protocol):
    def wait(self) -> Tick: ...


class Stalls:
    """Owns whether the single long stall of a failure is over."""

    def __init__(self, failures: Failures) -> None:
        self._failures = failures
        self._stalled: Failure | None = None

    def next_s(self) -> float:
        """Return the time for which the loop stalls before its next tick."""
        failure = self._failures.of("loop")
        if failure is None or failure is self._stalled:
            return 0.0
        if failure.kind is FailureKind.SLOW:
            return SLOW_TICK_S
        self._stalled = failure
        return STALL_S


class FailingTicker:
    """Updates the failures once a tick, and reports failures that have ended."""

    def __init__(
        self,
        ticker: TickSource,
        failures: Failures,
        report: Callable[[float, str], None],
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._ticker = ticker
        self._failures = failures
        self._stalls = Stalls(failures)
        self._report = report
        self._sleep = sleep

    def wait(self) -> Tick:
        stall_s = self._stalls.next_s()
        if stall_s:
            self._sleep(stall_s)
        tick = self._ticker.wait()
        for failure in self._failures.update(tick.now_s):
            self._report(tick.now_s, end_text(failure))
        return tick


def failing_ticker(ticker: TickSource, failures: Failures | None, report: Callable[[float, str], None]) -> TickSource:
    """Wrap the ticker, unless no failures are allowed."""
    return ticker if failures is None else FailingTicker(ticker, failures, report)


class FailingClock:
    """A wall clock that steps or stops on purpose."""

    def __init__(self, clock: Callable[[], float], failures: Failures) -> None:
        self._clock = clock
        self._failures = failures
        self._since: Failure | None = None

    def __call__(self) -> float:
        now_s, failure = self._clock(), self._failures.of("clock")
        if failure is None:
            return now_s
        if failure.kind is FailureKind.GARBAGE:
            return now_s + CLOCK_STEP_S
        if self._since is not failure:
            self._since, self._stuck_at_s = failure, now_s
        return self._stuck_at_s


def failing_clock(clock: Callable[[], float], failures: Failures | None) -> Callable[[], float]:
    """Wrap the clock, unless no failures are allowed."""
    return clock if failures is None else FailingClock(clock, failures)
