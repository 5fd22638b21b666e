"""Parts of the daemon that fail on purpose: a ticker that stalls, a wall clock that steps, a log that refuses rows.

The stall comes after a tick's work and before the wait for the next deadline, as if the work took too long. The log
reports the rows that it refused.
"""

import time
from collections.abc import Callable
from pathlib import Path

from drivers.fault_injection.failure_table import FailureKind
from drivers.fault_injection.failures import Failure, Failures, end_text
from firmware_host.log.recorder import STAMP, LogReport, Recording
from firmware_host.log.rows import EVENT, EVENT_KIND
from firmware_host.ticker import Tick, Ticker

STALL_S = 0.03  # eleven ticks: longer than a drive may be silent
SLOW_TICK_S = 0.004  # one and a half ticks
CLOCK_STEP_S = 3600.0


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
        ticker: Ticker,
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


class FailingRecorder:
    """A Recording that owns the count of the rows that it refused."""

    def __init__(self, recorder: Recording, failures: Failures) -> None:
        self._recorder = recorder
        self._failures = failures
        self._refused = self._unreported = 0
        self._loss_stamp_s = 0.0  # of the last refused row

    def put(self, kind_index: int, payload: bytes) -> bool:
        failure = self._failures.of("log")
        if failure and (failure.kind is not FailureKind.INTERMITTENT or self._failures.loses()):
            self._refused += 1
            self._unreported += 1
            (self._loss_stamp_s,) = STAMP.unpack_from(payload)
            return False
        self._report_loss()
        return self._recorder.put(kind_index, payload)

    @property
    def path(self) -> Path | None:
        return self._recorder.path

    def report(self) -> LogReport:
        report, failure = self._recorder.report(), self._failures.of("log")
        report = report._replace(dropped=report.dropped + self._refused)
        if failure is None:
            return report
        alive = report.alive and failure.kind is not FailureKind.OFF
        return report._replace(alive=alive, problem=f"the log is failing on purpose: {failure.kind}")

    def _report_loss(self) -> None:
        """Report missing rows before the first row after them, or at the end, as the recorder itself does."""
        if self._unreported:
            text = f"rows missing here: {self._unreported}, the log was failing on purpose"
            self._unreported = 0
            self._recorder.put(EVENT_KIND, EVENT.encode(self._loss_stamp_s, text))

    def close(self, timeout_s: float) -> bool:
        self._report_loss()
        return self._recorder.close(timeout_s)
