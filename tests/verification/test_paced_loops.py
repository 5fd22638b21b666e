"""Loops of others are compared by the difference of each interval from the period, and by their rate."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from verification.speed import paced_loops
from verification.speed.paced_loops import LOOPS, PacedTimes, present_loops

PERIOD_S = 0.001


class Wakes:
    """A loop whose intervals are given, and the clock that it moves."""

    def __init__(self, intervals_s: list[float]) -> None:
        self.now_s = 0.0
        self._intervals_s = intervals_s

    def clock(self) -> float:
        return self.now_s

    def loop(self, period_s: float) -> Iterator[object]:
        yield None
        for interval_s in self._intervals_s:
            self.now_s += interval_s
            yield None


def test_the_jitter_is_the_difference_of_an_interval_from_the_period_in_either_direction() -> None:
    wakes, times = Wakes([0.0010, 0.0013, 0.0007, 0.0010]), PacedTimes(PERIOD_S)
    times.run(wakes.loop, 0.0039, wakes.clock)
    report = times.report()
    assert report["jitter_us"]["max"] == pytest.approx(300.0)
    assert report["rate_fraction"] == pytest.approx(1.0)


def test_a_loop_that_drifts_reaches_a_fraction_of_its_rate() -> None:
    wakes, times = Wakes([1.25 * PERIOD_S] * 8), PacedTimes(PERIOD_S)
    times.run(wakes.loop, 9.9 * PERIOD_S, wakes.clock)
    assert times.report()["rate_fraction"] == pytest.approx(0.8)


def test_a_loop_that_a_signal_ends_is_reported() -> None:
    with pytest.raises(RuntimeError, match="signal"):
        PacedTimes(PERIOD_S).run(Wakes([PERIOD_S]).loop, 1.0, lambda: 0.0)


def test_loops_whose_modules_are_absent_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paced_loops, "find_spec", lambda module: None)
    assert set(present_loops()) == {"bare", "ticker"}


@pytest.mark.parametrize("name", LOOPS)
def test_every_loop_paces_and_leaves_the_signals_alone(name: str) -> None:
    module, loop = LOOPS[name]
    if module and not find_spec(module):
        pytest.skip(f"{module} is not installed")
    before, times = signal.getsignal(signal.SIGINT), PacedTimes(PERIOD_S)
    times.run(loop, 3.0 * PERIOD_S)
    assert times.report()["rate_fraction"] > 0.0
    assert signal.getsignal(signal.SIGINT) is before
