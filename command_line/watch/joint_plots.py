"""Draws angle, current or torque of every joint against time, from the samples of the last half hour."""

import time
from collections.abc import Callable
from math import degrees
from typing import NamedTuple

from rich.text import Text

from command_line.screen import clock_text
from command_line.watch.bars import bars
from command_line.watch.history import History
from experiments.reports.text_tables import number

NAME, RANGE = 16, 7  # columns to the left of the plots
SAMPLES = 2.0  # in a column, so that none is empty because a sample was late
SHORTEST_S = 0.2  # of a column
MOST_ZOOM = 128.0


class Signal(NamedTuple):
    """A signal of the joints."""

    title: str
    field: str  # of a Sample
    shown: Callable[[float], float]  # in the unit of the title
    floor: float  # the smallest range that fills the height, in that unit


SIGNALS = (
    Signal("angle (°)", "angle_rad", degrees, 2.0),
    Signal("current (A)", "current_a", float, 1.0),
    Signal("torque command (N·m)", "torque_command_nm", float, 0.1),
)


class View:
    """Owns what is shown: the signal, the end of the window, None for now, and the time that a column shows."""

    def __init__(self, period_s: float) -> None:
        """`period_s` is the time between two samples."""
        self.signal = 0
        self.end_s: float | None = None
        self._shortest_s = self.column_s = max(SAMPLES * period_s, SHORTEST_S)

    def zoom(self, factor: float) -> None:
        self.column_s = min(max(self.column_s * factor, self._shortest_s), MOST_ZOOM * self._shortest_s)

    def scroll(self, screens: float, history: History, width: int) -> None:
        """Move the window, back to where it begins with the oldest sample; at the newest it follows the time again."""
        first_s, last_s = history.samples[0].time_s, history.samples[-1].time_s
        span_s = _columns_in(width) * self.column_s
        end_s = max((self.end_s or last_s) + screens * span_s, first_s + span_s)
        self.end_s = None if end_s >= last_s else end_s

    def text(self, history: History, width: int, height: int) -> Text:
        """Return a plot for each joint, above the time of day at both ends."""
        signal, columns = SIGNALS[self.signal], _columns_in(width)
        names = [drive["joint"] for drive in history.status["drives"]]
        end_s = history.samples[-1].time_s if self.end_s is None else self.end_s
        begin_s = end_s - columns * self.column_s
        parts = [(f"{signal.title}\n", "bold")]
        lines = max((height - 2) // len(names), 2)
        for values, name in zip(self._columns(history, begin_s, columns), names, strict=True):
            parts += _plot(name, values, signal.floor, lines)
        ends = [clock_text(time.monotonic() - each_s) for each_s in (begin_s, end_s)]
        axis = ends[0].ljust(columns - len(ends[1])) + ends[1] if columns > 16 else ends[1]
        return Text.assemble(*parts, (" " * (NAME + RANGE + 1) + axis, "dim"), no_wrap=True, overflow="crop")

    def _columns(self, history: History, begin_s: float, columns: int) -> list[list[float | None]]:
        """Return the values of each joint: in each column the one of largest magnitude, or None where nothing came."""
        signal = SIGNALS[self.signal]
        found: list[list[float | None]] = [[None] * columns for _ in history.status["drives"]]
        for sample in reversed(history.samples):
            column = int((sample.time_s - begin_s) / self.column_s) if sample.time_s >= begin_s else -1
            if column < 0:
                break
            if column < columns:
                for row, value in zip(found, getattr(sample, signal.field), strict=True):
                    before = row[column]
                    if value is not None and (before is None or abs(signal.shown(value)) > abs(before)):
                        row[column] = signal.shown(value)
        return found


def _columns_in(width: int) -> int:
    return max(width - NAME - RANGE - 1, 1)


def _plot(name: str, values: list[float | None], floor: float, lines: int) -> list[tuple[str, str]]:
    """Return the lines of one joint: its name in the first, and the values at the top and the bottom."""
    known = [value for value in values if value is not None]
    low = min(known, default=None)
    high = None if low is None else max(*known, low + floor)
    names, ends = [name, *[""] * (lines - 1)], [number(high, 1), *[""] * (lines - 2), number(low, 1)]
    parts = []
    for left, end, line in zip(names, ends, bars(values, floor, lines), strict=True):
        parts += [(f"{left:{NAME}}", "bold"), (f"{end:>{RANGE}} ", "dim"), (f"{line}\n", "cyan")]
    return parts
