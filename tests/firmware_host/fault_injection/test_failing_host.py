"""The daemon's parts fail on purpose: the ticker stalls, the wall clock steps, the log loses rows."""

import pytest

from control.rate import PERIOD_S
from drivers.fault_injection.failures import Failures
from firmware_host.fault_injection.failing_host import (
    CLOCK_STEP_S,
    SLOW_TICK_S,
    STALL_S,
    FailingClock,
    FailingRecorder,
    FailingTicker,
)
from firmware_host.log.recorder import HEALTHY, LogReport
from firmware_host.ticker import Tick, Ticker
from tests.firmware_host.synthetic_clock import SyntheticClock
from tests.firmware_host.synthetic_rows import make_event
from tests.recorded_events import EventRecorder


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


def test_a_stuck_loop_stalls_once(bench: Bench) -> None:
    bench.wait(10)
    bench.failures.begin("loop", "stuck", bench.clock.now_s, 1.0)
    first, *others = bench.wait(100)
    assert (first.missed + 1) * PERIOD_S <= STALL_S < (first.missed + 2) * PERIOD_S
    assert all(tick.missed == 0 for tick in others)


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


class KeepingRecorder(EventRecorder):
    """A recorder that has already lost two rows by itself."""

    reported = HEALTHY._replace(dropped=2)
    closed_in_s = 0.0

    def report(self) -> LogReport:
        return self.reported

    def close(self, timeout_s: float) -> bool:
        self.closed_in_s = timeout_s
        return True


def failing_log() -> tuple[KeepingRecorder, Failures, FailingRecorder]:
    kept, failures = KeepingRecorder(), Failures(())
    return kept, failures, FailingRecorder(kept, failures)


def put_numbers(recorder: FailingRecorder, numbers: range) -> list[bool]:
    return [recorder.put(*make_event(str(number), float(number))) for number in numbers]


@pytest.mark.parametrize(("kind", "alive"), [("off", False), ("stuck", True)])
def test_a_failing_log_refuses_rows_and_then_logs_their_number(kind: str, alive: bool) -> None:
    kept, failures, recorder = failing_log()
    assert recorder.report() == kept.reported
    assert put_numbers(recorder, range(2)) == [True, True]
    failures.begin("log", kind, 2.0, 3.0)
    assert put_numbers(recorder, range(2, 5)) == [False] * 3
    report = recorder.report()
    assert (report.alive, report.dropped, report.free_fraction) == (alive, 5, HEALTHY.free_fraction)
    assert "on purpose" in report.problem and kind in report.problem
    failures.update(5.0)
    assert put_numbers(recorder, range(5, 7)) == [True, True]
    assert kept.texts == ["0", "1", "rows missing here: 3, the log was failing on purpose", "5", "6"]
    assert recorder.report() == HEALTHY._replace(dropped=5)


def test_a_log_that_ends_while_it_fails_reports_its_last_loss() -> None:
    kept, failures, recorder = failing_log()
    failures.begin("log", "off", 0.0, 9.0)
    put_numbers(recorder, range(3))
    assert recorder.close(2.5) and kept.closed_in_s == 2.5
    assert kept.texts == ["rows missing here: 3, the log was failing on purpose"]


def test_a_writer_that_died_by_itself_stays_dead() -> None:
    kept, failures, recorder = failing_log()
    kept.reported = HEALTHY._replace(alive=False)
    failures.begin("log", "stuck", 0.0)
    assert not recorder.report().alive
