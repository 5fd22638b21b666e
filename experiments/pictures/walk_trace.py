"""The rows of a walk that a picture needs: all of a short walk; of a long one, those at which something happens.

A picture has a few hundred columns of pixels, an hour's walk a million rows. Of every bin of ticks the trace therefore
has the rows in which a drawn column is first known, last known, smallest and largest: lines through these rows cover
the same pixels as lines through all (M4, Jugel et al., VLDB 2014). It also has the rows at which the phase changes, so
that a stride begins and ends where it did. All are rows of the log, so each reader of a walk reads a trace as well.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from control.modes import Mode
from logs.files.tick_array import Ticks

Rows = NDArray[np.void]

FIELDS = (
    "tick", "stamp_s", "phase", "angle_rad", "depth_m", "force_x_n", "force_z_n", "depth_command_m", "body_x_m",
)  # fmt: skip
DRAWN = ("depth_m", "force_x_n", "force_z_n", "depth_command_m", "body_x_m")
MOST_ROWS = 50_000  # of all walks of a log together: two minutes; matplotlib takes a kilobyte for each
FIRST_BIN = 32  # ticks; it has up to four rows for each drawn column, so a shorter one would save nothing
LEAST_GAIN = 0.9  # of the rows; beyond it a trace consists of the rows around changes of phase
AROUND = 2  # rows before and after a change of phase
CURVE_BINS = 2048  # of one curve of a long walk: several for each column of pixels


class WalkTrace:
    """Owns the rows of one walk; `row` is the number of its first row in the log."""

    def __init__(self, row: int) -> None:
        self.first_row = self.end_row = row
        self.start_s = np.nan
        self.bin_ticks = 0  # 0: every row is here
        self._parts: list[Rows] = []

    def add(self, ticks: Ticks) -> None:
        if self.end_row == self.first_row:
            self.start_s = float(ticks["stamp_s"][0])
        self.end_row += len(ticks)
        self._parts.append(drawn_rows(ticks))

    def __len__(self) -> int:
        return sum(map(len, self._parts))

    @property
    def rows(self) -> Rows:
        self._parts = [np.concatenate(self._parts)]
        return self._parts[0]

    def drop_rows(self) -> None:
        """Forgets the rows of a walk that is not drawn."""
        self._parts = []

    def thin(self, bin_ticks: int) -> None:
        self.bin_ticks = bin_ticks
        rows = self.rows
        self._parts = [rows[rows_drawn(rows, bin_ticks)]]


class WalkTraces:
    """Owns the traces of a log's walks, of which it keeps the rows of all, or of one."""

    def __init__(self, number: int | None = None) -> None:
        """`number` counts from 1, and 0 is the last walk; None: all walks."""
        self.walks: list[WalkTrace] = []
        self._number = number
        self._rows = 0
        self._room = MOST_ROWS
        self._goes_on = False

    def add(self, ticks: Ticks) -> None:
        """`ticks` are the next rows of the log."""
        walking = ticks["mode"] == Mode.WALKING
        edges = np.flatnonzero(np.diff(walking, prepend=False, append=False)).tolist()
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if begin or not self._goes_on:
                self._begin_walk(self._rows + begin)
            self.walks[-1].add(ticks[begin:end])
            if self._number and self._number != len(self.walks):
                self.walks[-1].drop_rows()
        self._rows += len(ticks)
        if len(ticks):
            self._goes_on = bool(walking[-1])
        self._thin()

    def _begin_walk(self, row: int) -> None:
        if self._number == 0 and self.walks:
            self.walks[-1].drop_rows()
        self.walks.append(WalkTrace(row))

    def _thin(self) -> None:
        """Doubles the bins of the largest trace until there is room again, or until that leaves out hardly any row."""
        if sum(map(len, self.walks)) <= self._room:
            return
        thinnable = [walk for walk in self.walks if len(walk)]
        for walk in thinnable:
            walk.thin(walk.bin_ticks or FIRST_BIN)
        while thinnable and sum(map(len, self.walks)) > MOST_ROWS // 2:
            largest = max(thinnable, key=len)
            before = len(largest)
            largest.thin(2 * largest.bin_ticks)
            if len(largest) > LEAST_GAIN * before:
                thinnable.remove(largest)
        self._room = max(MOST_ROWS, 2 * sum(map(len, self.walks)))


def drawn_rows(ticks: Ticks) -> Rows:
    rows = np.empty(len(ticks), [(name, ticks.dtype[name]) for name in FIELDS])
    for name in FIELDS:
        rows[name] = ticks[name]
    return rows


def rows_drawn(rows: Rows, bin_ticks: int) -> NDArray[np.bool_]:
    """Returns which rows of a walk are drawn; `rows` may be a trace with smaller bins."""
    bins = rows["tick"].astype(np.int64) // bin_ticks
    wanted = np.zeros(len(rows), dtype=np.bool_)
    wanted[[0, -1]] = True
    for change in np.flatnonzero(np.diff(rows["phase"])).tolist():
        wanted[max(0, change + 1 - AROUND) : change + 1 + AROUND] = True
    for values in _drawn_columns(rows):
        for chosen in _extremes(values, bins):
            wanted[chosen] = True
    return wanted


def rows_of_curve(time_s: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Returns the rows of a trace that one of its curves needs: a trace also has those of all other curves."""
    length_s = float(time_s[-1] - time_s[0])
    bins = (CURVE_BINS / length_s * (time_s - time_s[0])).astype(np.int64)
    is_known = np.isfinite(values)
    begin_or_end = np.flatnonzero(is_known[1:] != is_known[:-1])  # of a gap
    return np.unique(np.concatenate([begin_or_end, begin_or_end + 1, *_extremes(values, bins)]))


def _drawn_columns(rows: Rows) -> Iterator[NDArray[np.float64]]:
    for name in DRAWN:
        yield from np.atleast_2d(rows[name].T)


def _extremes(values: NDArray[np.float64], bins: NDArray[np.int64]) -> Sequence[NDArray[np.intp]]:
    """Returns the rows of the first, last, smallest and largest value of each bin."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return []
    values, bins = values[known], bins[known]
    begins = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
    ends = np.append(begins[1:], len(known))
    lengths = ends - begins
    found = [begins, ends - 1]
    for extreme in (np.minimum, np.maximum):
        reached = np.flatnonzero(values == np.repeat(extreme.reduceat(values, begins), lengths))
        found.append(reached[np.flatnonzero(np.diff(bins[reached], prepend=bins[0] - 1))])
    return [known[each] for each in found]
