"""The monitors of the loop's timing, under synthetic clocks, and of its log."""

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.faults import Blocks, Fault, FaultKind, Reaction
from control.parameters.fault_bounds import FaultBounds
from control.rate import PERIOD_S
from firmware_host.log.recorder import HEALTHY, LogReport
from firmware_host.loop_monitor import CRAWL_TICKS, MEAN_TICKS, LogMonitor, LoopMonitor
from firmware_host.ticker import Tick, Ticker
from tests.firmware_host.synthetic_clock import SyntheticClock

START_S = 5000.0
OFFSET_S = 1.7e9  # from the monotonic clock to the wall clock


def run_monitor(busy_s: Iterable[float]) -> list[list[Fault]]:
    """Return the faults of each tick, with work of `busy_s` before it."""
    clock = SyntheticClock(START_S)
    ticker, monitor = Ticker(clock=clock.read, sleep=clock.sleep), LoopMonitor(FaultBounds())
    reported = []
    for each in busy_s:
        clock.now_s += each
        reported.append(monitor.update(ticker.wait(), OFFSET_S))
    return reported


def names(reported: Iterable[Fault]) -> list[str]:
    return [fault.name for fault in reported]


def missing(ticks: int) -> float:
    """Return a duration of work that misses this number of ticks."""
    return (ticks + 1.5) * PERIOD_S


def after_missing(ticks: int) -> list[list[str]]:
    """Return the faults of the tick after this number of missed ones, and of the ticks that follow."""
    reported = run_monitor([0.001] * 200 + [missing(ticks)] + [0.001] * 250)
    assert reported[:200] == [[]] * 200
    return [names(each) for each in reported[200:]]


@pytest.mark.parametrize(
    ("ticks", "name"),
    [
        (1, "loop_overrun"),
        (4, "loop_overrun"),
        (5, "loop_lagging"),
        (9, "loop_lagging"),
        (10, "loop_stalled"),
        (400, "loop_stalled"),
    ],
)
def test_the_more_ticks_are_missed_in_a_row_the_harder_is_the_fault(ticks: int, name: str) -> None:
    first, *others = after_missing(ticks)
    assert first[0] == name
    assert name != "loop_overrun" or not any(others)


def test_a_stall_is_forgotten_after_the_ticks_of_a_mean() -> None:
    reported = after_missing(400)
    assert all("loop_lagging" in each for each in reported[:MEAN_TICKS])
    assert not any(reported[MEAN_TICKS:])


@pytest.mark.parametrize(("fraction", "expected"), [(0.0, False), (0.09, False), (0.12, True), (1.0, True)])
def test_a_mean_rate_that_is_too_low_is_a_lag(fraction: float, expected: bool) -> None:
    monitor = LoopMonitor(FaultBounds())
    reported = [
        monitor.update(Tick(START_S + tick * PERIOD_S * (1.0 + fraction), 0.0, tick, 0), OFFSET_S)
        for tick in range(300)
    ]
    assert not any(reported[:MEAN_TICKS])  # there is no mean of fewer ticks
    assert [names(each) for each in reported[MEAN_TICKS:]] == [["loop_lagging"] * expected] * (300 - MEAN_TICKS)


def stepped(step_s: float) -> list[list[str]]:
    monitor = LoopMonitor(FaultBounds())
    return [
        names(monitor.update(Tick(START_S + tick * PERIOD_S, 0.0, tick, 0), OFFSET_S + step_s * (tick >= 50)))
        for tick in range(100)
    ]


@pytest.mark.parametrize(
    ("step_s", "is_fault"), [(0.11, True), (-0.11, True), (-1.6e9, True), (0.09, False), (-0.09, False)]
)
def test_a_large_step_of_the_wall_clock_is_reported_once(step_s: float, is_fault: bool) -> None:
    assert stepped(step_s) == [[]] * 50 + [["clock_step"] * is_fault] + [[]] * 49


def test_a_drifting_wall_clock_is_no_fault() -> None:
    """ntpd slews a clock by at most 500 ppm."""
    monitor = LoopMonitor(FaultBounds())
    for tick in range(20000):
        now_s = START_S + tick * PERIOD_S
        assert not monitor.update(Tick(now_s, 0.0, tick, 0), OFFSET_S + 500e-6 * now_s)


@given(st.lists(st.floats(0.0, 0.05), max_size=150))
def test_every_missed_tick_is_reported(busy_s: list[float]) -> None:
    clock = SyntheticClock(START_S)
    ticker, monitor = Ticker(clock=clock.read, sleep=clock.sleep), LoopMonitor(FaultBounds())
    for each in busy_s:
        clock.now_s += each
        tick = ticker.wait()
        reported = names(monitor.update(tick, OFFSET_S))
        assert reported or not tick.missed


@pytest.mark.parametrize(("period_ticks", "crawls"), [(3.0, False), (4.05, True), (7.0, True), (12.0, True)])
def test_a_crawling_loop_is_reported_within_its_bound(period_ticks: float, crawls: bool) -> None:
    monitor = LoopMonitor(FaultBounds())
    ticks = [Tick(START_S + number * period_ticks * PERIOD_S, 0.0, number, 0) for number in range(40)]
    found = ["loop_crawling" in names(monitor.update(tick, OFFSET_S)) for tick in ticks]
    assert any(found) == crawls
    if crawls:
        assert found.index(True) * period_ticks <= max(FaultKind.LOOP_CRAWLING.bound_ticks, CRAWL_TICKS * period_ticks)


# the log

BOUNDS = FaultBounds(disk_free_fraction=0.05, disk_slow_s=2.0)


def log_faults(report: LogReport) -> list[str]:
    return [fault.name for fault in LogMonitor(BOUNDS).update(report)]


@pytest.mark.parametrize(
    ("well", "ill", "name"),
    [
        ({"free_fraction": 0.05}, {"free_fraction": 0.0499}, "disk_low"),
        ({"slowest_write_s": 2.0}, {"slowest_write_s": 2.01}, "disk_slow"),
        ({"problem": ""}, {"problem": "The log's disk is read-only."}, "log_unwritable"),
        ({"alive": True}, {"alive": False}, "recorder_dead"),
        ({"dropped": 0}, {"dropped": 1}, "rows_lost"),
    ],
)
def test_each_bound_has_two_sides(well: dict[str, object], ill: dict[str, object], name: str) -> None:
    assert log_faults(HEALTHY._replace(**well)) == []  # type: ignore[arg-type]
    assert log_faults(HEALTHY._replace(**ill)) == [name]  # type: ignore[arg-type]


def test_lost_rows_are_reported_once() -> None:
    watch = LogMonitor(BOUNDS)
    lost = HEALTHY._replace(dropped=7)
    assert watch.update(lost) == [FaultKind.ROWS_LOST.fault(rows=7)]
    assert watch.update(lost) == []
    assert len(watch.update(HEALTHY._replace(dropped=8))) == 1


def test_rows_that_a_dead_writer_does_not_take_are_no_second_fault() -> None:
    assert log_faults(HEALTHY._replace(alive=False, dropped=9)) == ["recorder_dead"]


def test_no_fault_of_the_log_stops_a_robot_and_an_unwritable_log_blocks_arming() -> None:
    ill = HEALTHY._replace(
        dropped=3, problem="No space left on device.", free_fraction=0.0, free_bytes=0, slowest_write_s=9.0
    )
    faults = LogMonitor(BOUNDS).update(ill) + LogMonitor(BOUNDS).update(HEALTHY._replace(alive=False))
    assert {fault.kind.reaction for fault in faults} == {Reaction.WARN}
    against = {fault.name for fault in faults if fault.kind.blocks is Blocks.UNLESS_FORCED}
    assert against == {"disk_low", "log_unwritable", "recorder_dead"}
