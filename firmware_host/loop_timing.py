"""Measures the loop's timing in histograms with buckets of one microsecond, so percentiles are exact to that."""

from array import array
from typing import Any

LONGEST_US = 20000  # everything longer falls into the last bucket; `max` stays exact
BLOCK_US = 200  # buckets that are counted together too, so that a percentile is found in one block


class Histogram:
    def __init__(self) -> None:
        self._counts = array("L", [0]) * (LONGEST_US + 1)
        self._block_counts = array("L", [0]) * (LONGEST_US // BLOCK_US + 1)
        self.count = 0
        self.max_us = 0.0

    def add(self, duration_s: float) -> None:
        duration_us = duration_s * 1e6
        bucket = int(duration_us) if duration_us > 0.0 else 0
        if bucket > LONGEST_US:
            bucket = LONGEST_US
        self._counts[bucket] += 1
        self._block_counts[bucket // BLOCK_US] += 1
        self.count += 1
        if duration_us > self.max_us:
            self.max_us = duration_us

    def percentile_us(self, fraction: float) -> float:
        """Return the duration that this fraction of all durations did not exceed, rounded up to a microsecond."""
        if self.count == 0:
            return 0.0
        wanted, counted, block = fraction * self.count, 0, 0
        while self._block_counts[block] == 0 or counted + self._block_counts[block] < wanted:
            counted += self._block_counts[block]
            block += 1
        duration_us = BLOCK_US * block
        while self._counts[duration_us] == 0 or counted + self._counts[duration_us] < wanted:
            counted += self._counts[duration_us]
            duration_us += 1
        return self.max_us if duration_us == LONGEST_US else float(duration_us + 1)

    def summary(self) -> dict[str, Any]:
        return {
            "p50": self.percentile_us(0.50),
            "p99": self.percentile_us(0.99),
            "max": round(self.max_us, 1),
        }


class LoopTiming:
    """Owns the histograms and counts since the last reset."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.wake_late, self.tick = Histogram(), Histogram()  # `tick` has the ticks before the last one
        self._tick_s = 0.0  # duration of the last tick so far: clients are served after it
        self.ticks = self.missed_ticks = 0
        self._first_s = self._last_s = 0.0

    def update(self, now_s: float, late_s: float, missed: int, tick_s: float) -> None:
        if self.ticks == 0:
            self._first_s = now_s
        else:
            self.missed_ticks += missed
            self.tick.add(self._tick_s)
        self._last_s = now_s
        self.ticks += 1
        self.wake_late.add(late_s)
        self._tick_s = tick_s

    def add_serving(self, serving_s: float) -> None:
        """Count the time after a tick in which clients are served as a part of it."""
        self._tick_s += serving_s

    @property
    def rate_hz(self) -> float:
        """Return the ticks that ran per second; missed ticks lower it."""
        elapsed_s = self._last_s - self._first_s
        return (self.ticks - 1) / elapsed_s if elapsed_s > 0.0 else 0.0

    def summary(self) -> dict[str, Any]:
        return {
            "ticks": self.ticks,
            "rate_hz": round(self.rate_hz, 4),
            "missed_ticks": self.missed_ticks,
            "wake_late_us": self.wake_late.summary(),
            "tick_us": self.tick.summary(),
        }
