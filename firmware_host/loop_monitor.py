"""Detects faults of the loop's own process: of its timing, of the wall clock, and of the log.

Trouble of the log does not stop a robot that moves; a log that cannot be written blocks arming.
"""

from collections import deque

from control.faults import Fault, FaultKind
from control.parameters.fault_bounds import FaultBounds
from control.rate import PERIOD_S
from firmware_host.log.recorder import LogReport
from firmware_host.ticker import Tick

MEAN_TICKS = 100  # ticks over which the mean rate is measured
CRAWL_TICKS = 5  # ticks over which a crawling loop is measured
CLOCK_STEP_S = 0.1  # more than a wall clock drifts between two ticks


class LoopMonitor:
    """Owns the stamps of the last ticks and the offset from the monotonic clock to the wall clock."""

    def __init__(self, bounds: FaultBounds, period_s: float = PERIOD_S) -> None:
        self._period_s = period_s
        self._bounds = bounds
        self._stamps_s: deque[float] = deque(maxlen=MEAN_TICKS + 1)
        self._clock_offset_s: float | None = None

    def update(self, tick: Tick, wall_minus_monotonic_s: float) -> list[Fault]:
        found = self._check_ticks(tick)
        before_s, self._clock_offset_s = self._clock_offset_s, wall_minus_monotonic_s
        if before_s is not None and abs(wall_minus_monotonic_s - before_s) > CLOCK_STEP_S:
            step_s = wall_minus_monotonic_s - before_s
            found.append(FaultKind.CLOCK_STEP.fault(step_s=step_s))
        return found

    def _check_ticks(self, tick: Tick) -> list[Fault]:
        found: list[Fault] = []
        now_s, stamps_s = tick.now_s, self._stamps_s
        if tick.missed:
            found.append(self._missed(tick))
        stamps_s.append(now_s)
        if len(stamps_s) > CRAWL_TICKS:
            mean_s = (now_s - stamps_s[-1 - CRAWL_TICKS]) / CRAWL_TICKS
            if mean_s > self._bounds.crawl_s:
                found.append(FaultKind.LOOP_CRAWLING.fault(tick_ms=1e3 * mean_s))
        if len(stamps_s) > MEAN_TICKS:
            fraction = (now_s - stamps_s[0]) / (MEAN_TICKS * self._period_s) - 1.0
            if fraction > self._bounds.lag_fraction:
                extent = f"its ticks take {100.0 * fraction:.0f} % too long"
                found.append(FaultKind.LOOP_LAGGING.fault(extent=extent))
        return found

    def _missed(self, tick: Tick) -> Fault:
        missed_s = tick.missed * self._period_s
        if missed_s > self._bounds.silence_s:
            return FaultKind.LOOP_STALLED.fault(late_ms=1e3 * tick.late_s)
        if missed_s > self._bounds.lag_s:
            return FaultKind.LOOP_LAGGING.fault(extent=f"{tick.missed} ticks in a row were missed")
        return FaultKind.LOOP_OVERRUN.fault(missed=tick.missed)


class LogMonitor:
    """Turns the reports of the log's writer into faults. Owns the number of rows lost so far."""

    def __init__(self, bounds: FaultBounds) -> None:
        self._bounds = bounds
        self._dropped = 0

    def update(self, report: LogReport) -> list[Fault]:
        found: list[Fault] = []
        if not report.alive:
            found.append(FaultKind.RECORDER_DEAD.fault())
        elif report.problem:
            found.append(FaultKind.LOG_UNWRITABLE.fault(reason=report.problem))
        if report.free_fraction < self._bounds.disk_free_fraction:
            percent, free_mb = 100.0 * report.free_fraction, report.free_bytes / 1e6
            found.append(FaultKind.DISK_LOW.fault(free_percent=percent, free_mb=free_mb))
        if report.slowest_write_s > self._bounds.disk_slow_s:
            found.append(FaultKind.DISK_SLOW.fault(write_s=report.slowest_write_s))
        if report.alive and report.dropped > self._dropped:
            found.append(FaultKind.ROWS_LOST.fault(rows=report.dropped))
        self._dropped = report.dropped
        return found
