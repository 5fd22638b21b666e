"""A log that fails on purpose, around one that works. Rows that it refuses are counted and reported in the log."""

from __future__ import annotations

from pathlib import Path

from drivers.fault_injection.failures import FailureKind, Failures
from firmware_host.log.recorder import STAMP, LogReport, Recording
from firmware_host.log.rows import EVENT, EVENT_KIND


class FailingRecorder:
    """A Recording that owns the count of the rows that it refused."""

    def __init__(self, recorder: Recording, failures: Failures) -> None:
        self._recorder = recorder
        self._failures = failures
        self._refused = self._unreported = 0
        self._count()

    def _count(self) -> None:
        failure = self._failures.of("log")
        self.dropped = self._recorder.dropped + self._refused
        self.writer_alive = self._recorder.writer_alive and (failure is None or failure.kind is not FailureKind.OFF)

    def put(self, kind_index: int, payload: bytes) -> bool:
        if self._refuses():
            self._refused += 1
            self._unreported += 1
            taken = False
        else:
            self._report_loss(payload)
            taken = self._recorder.put(kind_index, payload)
        self._count()
        return taken

    @property
    def path(self) -> Path | None:
        return self._recorder.path

    def report(self) -> LogReport:
        report, failure = self._recorder.report(), self._failures.of("log")
        self._count()
        if failure is None:
            return report._replace(dropped=self.dropped)
        problem = f"the log is failing on purpose: {failure.kind}"
        return report._replace(alive=self.writer_alive, dropped=self.dropped, problem=problem)

    def _refuses(self) -> bool:
        failure = self._failures.of("log")
        if failure is None:
            return False
        return failure.kind is not FailureKind.INTERMITTENT or self._failures.loses()

    def _report_loss(self, payload: bytes) -> None:
        """Report missing rows before the first row after them, with the stamp of that row."""
        if self._unreported:
            (stamp_s,) = STAMP.unpack_from(payload)
            text = f"rows missing here: {self._unreported}, the log was failing on purpose"
            self._unreported = 0
            self._recorder.put(EVENT_KIND, EVENT.encode(stamp_s, text))

    def close(self, timeout_s: float) -> bool:
        return self._recorder.close(timeout_s)


def failing_recorder(recorder: Recording, failures: Failures | None) -> Recording:
    """Wrap the recorder, unless no failures are allowed."""
    return recorder if failures is None else FailingRecorder(recorder, failures)
