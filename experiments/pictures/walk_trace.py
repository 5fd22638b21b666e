"""The rows of a walk that a picture needs: all of a short log; of a long one, those at which something happens.

A picture has a few hundred columns of pixels, an hour's walk a million rows. Of every bin of ticks the trace therefore
has the rows in which a drawn column is first known, last known, smallest and largest: lines through these rows cover
the same pixels as lines through all (M4, Jugel et al., VLDB 2014). It also has the rows at which the phase changes, so
that a stride begins and ends where it did. All are rows of the log, so each reader of a walk reads a trace as well.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from control.modes import Mode
from logs.files.tick_array import Ticks

Rows = NDArray[np.void]

FIELDS = (
    "tick", "stamp_s", "phase", "angle_rad", "depth_m", "force_x_n", "force_z_n", "depth_command_m", "body_x_m",
)  # fmt: skip
DRAWN = ("depth_m", "force_x_n", "force_z_n", "depth_command_m", "body_x_m")
MOST_ROWS = 50_000  # of a log that is drawn whole: two minutes; matplotlib takes a kilobyte for each
ROWS_A_BIN = 16  # of the four for each of the eight drawn columns, those that differ
AROUND = 2  # rows before and after a change of phase
CURVE_BINS = 2048  # of one curve of a long walk: several for each column of pixels


class WalkTrace:
    """Owns the rows of one walk, which begins with row `first_row` of the log and ends before `end_row`."""

    def __init__(self, row: int, start_s: float) -> None:
        self.first_row = self.end_row = row
        self.start_s = start_s
        self.parts: list[Rows] = []

    @property
    def rows(self) -> Rows:
        self.parts = [np.concatenate(self.parts)]
        return self.parts[0]


class WalkTraces:
    """Owns the traces of a log's walks, of which it keeps the rows of all, or of one."""

    def __init__(self, rows: int, number: int | None = None) -> None:
        """`rows` is the length of the log. `number` counts from 1, and 0 is the last walk; None: all walks."""
        self.walks: list[WalkTrace] = []
        self.bin_ticks = 0 if rows <= MOST_ROWS else ROWS_A_BIN * rows // MOST_ROWS  # 0: every row is here
        self._number = number
        self._rows = 0
        self._goes_on = False

    def add(self, ticks: Ticks) -> None:
        """`ticks` are the next rows of the log."""
        walking = ticks["mode"] == Mode.WALKING
        edges = np.flatnonzero(np.diff(walking, prepend=False, append=False)).tolist()
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if begin or not self._goes_on:
                if self._number == 0 and self.walks:
                    self.walks[-1].parts = []
                self.walks.append(WalkTrace(self._rows + begin, float(ticks["stamp_s"][begin])))
            walk = self.walks[-1]
            walk.end_row = self._rows + end
            if not self._number or self._number == len(self.walks):
                rows = drawn_rows(ticks[begin:end])
                walk.parts.append(rows[rows_drawn(rows, self.bin_ticks)] if self.bin_ticks else rows)
        self._rows += len(ticks)
        self._goes_on = bool(walking[-1]) if len(ticks) else self._goes_on


def drawn_rows(ticks: Ticks) -> Rows:
    rows = np.empty(len(ticks), [(name, ticks.dtype[name]) for name in FIELDS])
    for name in FIELDS:
        rows[name] = ticks[name]
    return rows


def rows_drawn(rows: Rows, bin_ticks: int) -> NDArray[np.bool_]:
    """Return which rows of a walk are drawn."""
    bins = rows["tick"].astype(np.int64) // bin_ticks
    wanted = np.zeros(len(rows), dtype=np.bool_)
    wanted[[0, -1]] = True
    for change in np.flatnonzero(np.diff(rows["phase"])).tolist():
        wanted[max(0, change + 1 - AROUND) : change + 1 + AROUND] = True
    for name in DRAWN:
        for values in np.atleast_2d(rows[name].T):
            wanted[np.concatenate([[0], *_extremes(values, bins)])] = True
    return wanted


def rows_of_curve(time_s: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the rows of a trace that one of its curves needs: a trace also has those of all other curves."""
    length_s = float(time_s[-1] - time_s[0])
    bins = (CURVE_BINS / length_s * (time_s - time_s[0])).astype(np.int64)
    is_known = np.isfinite(values)
    begin_or_end = np.flatnonzero(is_known[1:] != is_known[:-1])  # of a gap
    return np.unique(np.concatenate([begin_or_end, begin_or_end + 1, *_extremes(values, bins)]))


def _extremes(values: NDArray[np.float64], bins: NDArray[np.int64]) -> Sequence[NDArray[np.intp]]:
    """Return the rows of the first, last, smallest and largest value of each bin."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return []
    values, bins = values[known], bins[known]
    begins = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
    ends = np.append(begins[1:], len(known))
    found = [begins, ends - 1]
    for extreme in (np.minimum, np.maximum):
        reached = np.flatnonzero(values == np.repeat(extreme.reduceat(values, begins), ends - begins))
        found.append(reached[np.flatnonzero(np.diff(bins[reached], prepend=bins[0] - 1))])
    return [known[each] for each in found]
