"""Estimates when each line was measured, from the times at which lines arrive.

An amplifier converts at a steady rate of its own, and so does the counter of an encoder. Its lines then wait in the
adapter (an FTDI chip delivers its buffer every 16 ms), in the kernel, and until the program reads. So several lines
arrive at once, each late by a different time. The stamps run at the measured period and follow the arrivals slowly; a
constant delay remains, which shifts a whole stroke and changes nothing within it. If a line arrives more than GAP
periods late, other lines are missing. Malformed lines count as well, because each took its time. A period that was
measured while a busy computer delivered late would turn every few lines into a gap: where one gap follows another, the
period is measured again.
"""

from collections import deque

from drivers.serial.serial_line import SerialLine

GAIN = 0.05  # of the difference between arrival and expectation
GAP = 3.0  # periods
LEAST_GAP_S = 0.06  # longer than the bursts of an adapter and a busy computer
MEASURED_LINES, MEASURED_S = 16, 0.5
REMEMBERED_READS = 512
BITS_PER_BYTE = 10.0
LEAST_STEP_S = 1e-6


class LineClock:
    """Owns the period of the lines and the stamp of the last one."""

    def __init__(self, baud: int) -> None:
        self._line_s = 16.0 * BITS_PER_BYTE / baud  # of one line on the wire
        self.drop_outs = 0
        self.reset()

    def reset(self) -> None:
        """Forget the period, after the device was away."""
        self.period_s: float | None = None  # until enough lines have arrived
        self._stamp_s: float | None = None
        self._measure_again()

    @property
    def rate_hz(self) -> float | None:
        """The rate of the lines; None until enough have arrived."""
        return None if self.period_s is None else 1.0 / self.period_s

    def _measure_again(self) -> None:
        """Begin to measure the period; the previous one stays in use meanwhile."""
        self._is_measured = False
        self._reads: deque[tuple[float, int]] = deque(maxlen=REMEMBERED_READS)  # time, and number of lines until then
        self._lines = 0

    def stamps_s(self, lines: int, now_s: float) -> list[float]:
        """Return the stamps of this many lines, all read now, oldest first."""
        stamps_s = [self._next_stamp_s(now_s, later) for later in range(lines - 1, -1, -1)]
        if lines:
            self._lines += lines
            self._reads.append((now_s, self._lines))
            first_s, first = self._reads[0]
            if self._lines - first >= MEASURED_LINES and now_s - first_s >= MEASURED_S:
                self.period_s, self._is_measured = (now_s - first_s) / (self._lines - first), True
        return stamps_s

    def _next_stamp_s(self, now_s: float, later_lines: int) -> float:
        period_s, before_s = self.period_s, self._stamp_s
        arrived_s = now_s - later_lines * (self._line_s if period_s is None else period_s)
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
            if not self._is_measured:
                self.period_s = None
            self._measure_again()
            return arrived_s
        return min(expected_s + GAIN * late_s, now_s)


class SampledLine(SerialLine):
    """A serial line whose device measures at a steady rate. Owns its clock."""

    def __init__(self, path: str, baud: int) -> None:
        """Open the line; raises SerialLineError where it does not open."""
        self.clock = LineClock(baud)
        super().__init__(path, baud)

    def reset(self) -> None:
        super().reset()
        self.clock.reset()

    def read_stamped(self, now_s: float) -> list[tuple[float, bytes]]:
        """Return all complete lines, oldest first, each with the time at which it was measured."""
        lines = self.read(now_s)
        return list(zip(self.clock.stamps_s(len(lines), now_s), lines, strict=True))
