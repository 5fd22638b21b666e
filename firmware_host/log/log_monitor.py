"""What the log's writer tells against recording: a full, slow or lost disk, rows that were lost, its own death.

None of it stops a robot that moves; a log that cannot be written stands against arming.
"""

from __future__ import annotations

from control.fault_kinds import make_fault
from control.faults import Fault
from control.monitors.joint_monitor import FaultBounds
from firmware_host.log.recorder import LogReport
from firmware_host.operator.counted_nouns import counted


class LogMonitor:
    """Owns the number of rows lost so far."""

    def __init__(self, bounds: FaultBounds) -> None:
        self._bounds = bounds
        self.reset()

    def reset(self) -> None:
        self._dropped = 0

    def update(self, report: LogReport) -> list[Fault]:
        found: list[Fault] = []
        if not report.alive:
            found.append(make_fault("recorder_dead", "", "The log's writer has died: nothing is recorded."))
        elif report.problem:
            found.append(make_fault("log_unwritable", "", report.problem))
        if report.free_fraction < self._bounds.disk_free_fraction:
            text = f"The log's disk has {100.0 * report.free_fraction:.1f} % free ({report.free_bytes / 1e6:.0f} MB)."
            found.append(make_fault("disk_low", "", text))
        if report.slowest_write_s > self._bounds.disk_slow_s:
            found.append(make_fault("disk_slow", "", f"The log's disk took {report.slowest_write_s:.1f} s to write."))
        if report.alive and report.dropped > self._dropped:
            found.append(make_fault("rows_lost", "", f"The log lost {counted(report.dropped, 'row')} so far."))
        self._dropped = report.dropped
        return found
