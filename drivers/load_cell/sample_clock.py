"""When a line was measured, as far as its arrival tells.

An amplifier converts at a steady rate of its own, and so does the counter of an encoder. Its lines then wait: in the
adapter (an FTDI chip hands over what it has every 16 ms), in the kernel, and until somebody reads. So several come at
once, all of them late by different times. The stamps here run at the measured period and follow the arrivals slowly; a
constant delay remains, which moves a whole stroke and nothing within it. A line that comes more than GAP periods late
is no late line: others are missing. Garbled lines count as well, since each took its time. A period that was learned
while a busy computer handed over late what it had would make a gap of every few lines: where one gap follows another
the period is learned anew.
"""

from __future__ import annotations

from collections import deque

GAIN = 0.05  # of the difference between arrival and expectation
GAP = 3.0  # periods
LEAST_GAP_S = 0.06  # bursts of an adapter and a busy computer
LEARNING_LINES, LEARNING_S = 16, 0.5
REMEMBERED_READS = 512
BITS_PER_BYTE = 10.0
LEAST_STEP_S = 1e-6


class LineClock:
    """Owns the period of the lines and the stamp of the last one."""

    def __init__(self, baud: int) -> None:
        self._line_s = 16.0 * BITS_PER_BYTE / baud  # that a line takes on the wire
        self.drop_outs = 0
        self.reset()

    def reset(self) -> None:
        """The amplifier was away."""
        self.period_s: float | None = None  # until a few lines have come
        self._stamp_s: float | None = None
        self._begin()

    @property
    def rate_hz(self) -> float | None:
        """Of the lines, once a few have come."""
        return None if self.period_s is None else 1.0 / self.period_s

    def _begin(self) -> None:
        """Learning, and keep the period meanwhile."""
        self._has_learned = False
        self._reads: deque[tuple[float, int]] = deque(maxlen=REMEMBERED_READS)  # when, and how many lines by then
        self._lines = 0

    def stamps_s(self, lines: int, now_s: float) -> list[float]:
        """Of as many lines, all read at this moment, oldest first."""
        stamps_s = [self._next_s(now_s, behind) for behind in range(lines - 1, -1, -1)]
        if lines:
            self._lines += lines
            self._reads.append((now_s, self._lines))
            self._learn()
        return stamps_s

    def _learn(self) -> None:
        (first_s, first), (last_s, last) = self._reads[0], self._reads[-1]
        if last - first >= LEARNING_LINES and last_s - first_s >= LEARNING_S:
            self.period_s, self._has_learned = (last_s - first_s) / (last - first), True

    def _next_s(self, now_s: float, behind: int) -> float:
        period_s, before_s = self.period_s, self._stamp_s
        arrived_s = now_s - behind * (self._line_s if period_s is None else period_s)
        if before_s is None:
            stamp_s = arrived_s
        elif period_s is None:
            stamp_s = max(arrived_s, before_s + LEAST_STEP_S)
        else:
            stamp_s = max(self._followed_s(before_s + period_s, period_s, arrived_s, now_s), before_s + LEAST_STEP_S)
        self._stamp_s = stamp_s
        return stamp_s

    def _followed_s(self, expected_s: float, period_s: float, arrived_s: float, now_s: float) -> float:
        late_s = arrived_s - expected_s
        if late_s > max(GAP * period_s, LEAST_GAP_S):
            self.drop_outs += 1
            if not self._has_learned:
                self.period_s = None
            self._begin()
            return arrived_s
        return min(expected_s + GAIN * late_s, now_s)
