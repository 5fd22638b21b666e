"""Turns the reports of the log's writer into faults: a full, slow or lost disk, lost rows, a dead writer.

None of it stops a robot that moves; a log that cannot be written stands against arming.
"""

from __future__ import annotations

from control.faults import Fault, FaultKind
from control.monitors.joint_monitor import FaultBounds
from firmware_host.log.recorder import LogReport


class LogMonitor:
    """Owns the number of rows lost so far."""

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
