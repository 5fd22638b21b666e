"""A log that fails on purpose counts the refused rows and reports their number."""

from __future__ import annotations

import pytest

from drivers.fault_injection.failures import Failures
from firmware_host.fault_injection.failing_recorder import FailingRecorder, failing_recorder
from firmware_host.log.recorder import NullRecorder
from firmware_host.log.rows import EVENT, EVENT_KIND


class KeepingRecorder(NullRecorder):
    """Stores the texts of events, and has lost two rows by itself."""

    def __init__(self) -> None:
        self.dropped = 2
        self.texts: list[str] = []
        self.closed_in_s = 0.0

    def put(self, kind_index: int, payload: bytes) -> bool:
        self.texts.append(EVENT.decode(payload)["text"])
        return True

    def close(self, timeout_s: float) -> bool:
        self.closed_in_s = timeout_s
        return True


def put_numbers(recorder: FailingRecorder, numbers: range) -> list[bool]:
    return [recorder.put(EVENT_KIND, EVENT.encode(float(number), str(number))) for number in numbers]


@pytest.mark.parametrize(("kind", "alive"), [("off", False), ("stuck", True)])
def test_a_failing_log_refuses_rows_and_then_logs_their_number(kind: str, alive: bool) -> None:
    kept, failures = KeepingRecorder(), Failures(())
    recorder = FailingRecorder(kept, failures)
    assert put_numbers(recorder, range(2)) == [True, True]
    failures.begin("log", kind, 2.0, 3.0)
    assert put_numbers(recorder, range(2, 5)) == [False] * 3
    assert (recorder.dropped, recorder.writer_alive) == (5, alive)
    failures.update(5.0)
    assert put_numbers(recorder, range(5, 7)) == [True, True]
    assert kept.texts == ["0", "1", "rows missing here: 3, the log was failing on purpose", "5", "6"]
    assert (recorder.dropped, recorder.writer_alive) == (5, True)


def test_an_intermittent_log_loses_about_half_and_logs_each_gap() -> None:
    kept, failures = KeepingRecorder(), Failures(())
    recorder = FailingRecorder(kept, failures)
    failures.begin("log", "intermittent", 0.0)
    taken = put_numbers(recorder, range(200))
    failures.end_all()
    put_numbers(recorder, range(200, 201))
    reported = sum(int(text.split()[3].rstrip(",")) for text in kept.texts if text.startswith("rows missing"))
    assert 60 < sum(taken) < 140
    assert reported == taken.count(False) == recorder.dropped - 2


def test_a_writer_that_died_by_itself_stays_dead() -> None:
    kept = KeepingRecorder()
    kept.writer_alive = False
    assert not FailingRecorder(kept, Failures(())).writer_alive


@pytest.mark.parametrize(("kind", "alive"), [("off", False), ("stuck", True), ("intermittent", True)])
def test_the_report_of_a_failing_log_shows_failure_and_lost_rows(kind: str, alive: bool) -> None:
    kept, failures = KeepingRecorder(), Failures(())
    recorder = FailingRecorder(kept, failures)
    assert recorder.report() == kept.report()._replace(dropped=2)
    failures.begin("log", kind, 0.0)
    refused = put_numbers(recorder, range(20)).count(False)
    report = recorder.report()
    assert (report.alive, report.dropped, report.free_fraction) == (alive, 2 + refused, kept.report().free_fraction)
    assert refused and "on purpose" in report.problem and kind in report.problem
    failures.end_all()
    assert recorder.report() == kept.report()._replace(dropped=2 + refused)
    assert recorder.path is kept.path


def test_closing_reaches_the_log() -> None:
    kept = KeepingRecorder()
    assert FailingRecorder(kept, Failures(())).close(3.0) and kept.closed_in_s == 3.0


def test_a_log_that_may_not_fail_is_not_wrapped() -> None:
    recorder = NullRecorder()
    assert failing_recorder(recorder, None) is recorder
