"""Loops that wait for the next period and do nothing else: ours, those of two libraries, and the C library's sleep.

`bare` calls clock_nanosleep with absolute deadlines, the most punctual wait that the machine allows without spinning.
`ticker` is the daemon's. `loop-rate-limiters` sleeps until a period after its last return. `opensourceleg` is
OpenSourceLeg's SoftRealtimeLoop, which sleeps for the rest of a period since the last one began;
`opensourceleg (phase)` is the same with `maintain_original_phase`, which keeps to absolute deadlines. The libraries are
optional: `pip install 'mudskipper[loops]'`.

Loops without absolute deadlines have no lateness, so all are compared by their jitter, the difference of each interval
from the period, and by their mean rate.
"""

import ctypes
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from firmware_host.loop_timing import Histogram
from firmware_host.ticker import Tick, Ticker

TIMER_ABSTIME = 1
HANDLED_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)  # by OpenSourceLeg's loop
PacedLoop = Callable[[float], Iterator[object]]  # from a period to the wake-ups


class Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


class BareTicker:
    """Waits as the daemon's ticker does, by the C library's clock_nanosleep."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._until, self._sleep = Timespec(), ctypes.CDLL(None).clock_nanosleep
        self._start_s, self._number = time.monotonic(), 0

    def wait(self) -> Tick:
        self._number += 1
        deadline_s = self._start_s + self._number * self._period_s
        self._until.seconds, self._until.nanoseconds = int(deadline_s), int(deadline_s % 1.0 * 1e9)
        self._sleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, ctypes.byref(self._until), None)
        now_s = time.monotonic()
        missed = int((now_s - deadline_s) / self._period_s)
        self._number += missed
        return Tick(now_s, now_s - deadline_s, self._number, missed)


def pace_bare(period_s: float) -> Iterator[object]:
    ticker = BareTicker(period_s)
    while True:
        yield ticker.wait()


def pace_ticker(period_s: float) -> Iterator[object]:
    ticker = Ticker(period_s)
    while True:
        yield ticker.wait()


def pace_rate_limiter(period_s: float) -> Iterator[object]:
    from loop_rate_limiters import RateLimiter

    limiter = RateLimiter(frequency=1.0 / period_s, warn=False)
    while True:
        yield limiter.sleep()


def pace_open_source_leg(period_s: float, keep_phase: bool = False) -> Iterator[object]:
    from opensourceleg.utilities.softrealtimeloop import SoftRealtimeLoop

    with _restored_signals():
        yield from SoftRealtimeLoop(dt=period_s, report=False, maintain_original_phase=keep_phase)


@contextmanager
def _restored_signals() -> Iterator[None]:
    handlers = {number: signal.getsignal(number) for number in HANDLED_SIGNALS}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


LOOPS: dict[str, tuple[str, PacedLoop]] = {  # with the module that each needs
    "bare": ("", pace_bare),
    "ticker": ("", pace_ticker),
    "loop-rate-limiters": ("loop_rate_limiters", pace_rate_limiter),
    "opensourceleg": ("opensourceleg", pace_open_source_leg),
    "opensourceleg (phase)": ("opensourceleg", lambda period_s: pace_open_source_leg(period_s, keep_phase=True)),
}


def present_loops() -> dict[str, PacedLoop]:
    """Returns the loops whose modules are installed."""
    return {name: loop for name, (module, loop) in LOOPS.items() if not module or find_spec(module)}


class PacedTimes:
    """Owns the jitter of one loop at one rate, over several turns."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._jitter = Histogram()
        self._elapsed_s = 0.0

    def run(self, loop: PacedLoop, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Raises RuntimeError where the loop ends early."""
        wake_ups = loop(self.period_s)
        try:
            next(wake_ups)
            last_s = start_s = clock()
            for _ in wake_ups:
                now_s = clock()
                self._jitter.add(abs(now_s - last_s - self.period_s))
                last_s = now_s
                if now_s - start_s >= seconds:
                    self._elapsed_s += now_s - start_s
                    return
        finally:
            getattr(wake_ups, "close", lambda: None)()
        raise RuntimeError("a signal ended the loop")

    def report(self) -> dict[str, Any]:
        """Returns the jitter, and the mean rate as a fraction of the requested rate."""
        return {
            "jitter_us": self._jitter.summary(),
            "rate_fraction": round(self._jitter.count * self.period_s / self._elapsed_s, 4),
        }
