"""The time of a computer that is slower than this one by a factor: a clock for a lockstep, and the walk that uses it.

A tick takes as long as this thread computes in it, by the processor's own count, times the factor. Between ticks the
clock stands still while the simulated robot computes, and jumps over the sleep until the next deadline. The loop reads
this clock, and the daemon's ticker waits by it, so a deadline that the slow computer misses is missed here. With
recorded work instead of this thread's own, the walk does not depend on the other programs of this computer.
"""

import time
from collections.abc import Callable

from control.rate import PERIOD_S
from firmware_host.configuration.configuration import Configuration
from firmware_host.ticker import Ticker
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import Track


class ScaledClock:
    """Runs `factor` times as fast as this thread works, between `start` and `stop`. With factor 0 it stands still."""

    def __init__(self, factor: float, worked_s: Callable[[], float] = time.thread_time) -> None:
        self.factor = factor
        self._worked_s = worked_s
        self._stopped_s = 0.0
        self._begun_s: float | None = None

    def now(self) -> float:
        if self._begun_s is None:
            return self._stopped_s
        return self._stopped_s + self.factor * (self._worked_s() - self._begun_s)

    def start(self) -> None:
        self._begun_s = self._worked_s()

    def stop(self) -> float:
        """Returns for how long this thread has worked since the start, unscaled."""
        assert self._begun_s is not None
        worked_s = self._worked_s() - self._begun_s
        self._stopped_s += self.factor * worked_s
        self._begun_s = None
        return worked_s

    def sleep(self, duration_s: float) -> None:
        self._stopped_s += duration_s


class RecordedWork:
    """The count of recorded work, for a clock. In a tick the first reading precedes the work, all others follow it."""

    def __init__(self) -> None:
        self.next_s = 0.0  # the work of the next tick
        self._done_s = 0.0

    def __call__(self) -> float:
        done_s = self._done_s
        self._done_s, self.next_s = done_s + self.next_s, 0.0
        return done_s


class ScaledWalk(Lockstep):
    """A lockstep whose time is that of a scaled clock. It does not support injected failures or late ticks."""

    def __init__(self, configuration: Configuration, track: Track, clock: ScaledClock) -> None:
        self._clock = clock
        super().__init__(configuration, track)
        self._ticker = Ticker(PERIOD_S, clock.now, clock.sleep)
        self.worked_s = 0.0  # in the last tick, unscaled

    @property
    def now_s(self) -> float:
        return self._clock.now()

    def step(self) -> None:
        tick = self._ticker.wait()
        self.tick_number = tick.number
        self.robot.advance(tick.now_s)
        self._clock.start()
        self.loop.tick(tick)
        self.worked_s = self._clock.stop()
