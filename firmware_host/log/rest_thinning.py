"""Writes one tick in many while the robot rests without torque, and every tick that leads to torque.

A robot that waits for its operator would fill its disk with rows that say nothing. The log's writer therefore thins the
ticks of the modes without torque and holds the rows that it leaves out in memory for a few seconds. When the mode
changes, or torque comes on, the held rows are written after all, so the seconds before are complete. In the file they
follow thinned rows of the same time, and the readers sort by the tick's number. The end of a run counts as such a
change. Strides and events are never thinned.
"""

import struct
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from control.modes import ENERGISED
from control.rate import RATE_HZ
from firmware_host.log.rows import TICK, TICK_KIND
from firmware_host.log.schema import RowKind


class Thinned(NamedTuple):
    rows: list[tuple[int, bytes]]  # to be written
    notice: str  # event text where the thinning begins or ends, or empty


class RestThinning:
    """Owns the ticks that are held back."""

    def __init__(self, rest_hz: float, full_s: float, ticks: RowKind = TICK) -> None:
        self._mode_at, self._number_at = ticks.offset_of("mode"), ticks.offset_of("tick")
        self._every = max(1, round(RATE_HZ / rest_hz)) if rest_hz > 0.0 else 1
        self._full_ticks = round(full_s * RATE_HZ)
        self._held: deque[tuple[int, bytes]] = deque(maxlen=self._full_ticks)
        self._mode = -1
        self._rested = 0  # ticks since torque or a change of mode
        self.resting = False  # for longer than is recorded in full

    def thin(self, rows: Iterable[tuple[int, bytes]]) -> Thinned:
        """Return the rows to write, in the order in which they came."""
        written: list[tuple[int, bytes]] = []
        notice = ""
        for row in rows:
            if row[0] == TICK_KIND and len(row[1]) > self._mode_at:
                notice = "; ".join(filter(None, (notice, self._add_tick(row, written))))
            else:
                written.append(row)
        return Thinned(written, notice)

    def _add_tick(self, row: tuple[int, bytes], written: list[tuple[int, bytes]]) -> str:
        mode = row[1][self._mode_at]
        active = mode in ENERGISED or mode != self._mode
        self._mode = mode
        self._rested = 0 if active else self._rested + 1
        was_resting, self.resting = self.resting, self._rested > self._full_ticks
        if was_resting and not self.resting and self._every > 1:
            held = self.release()
            written += held
            written.append(row)
            return f"end of the rest: the {len(held)} ticks held back before this one are written after all"
        (number,) = struct.unpack_from("<I", row[1], self._number_at)
        (self._held if self.resting and number % self._every else written).append(row)
        begins = self.resting and not was_resting and self._every > 1
        return f"at rest: of the ticks, one in {self._every} is written from here on" if begins else ""

    def release(self) -> list[tuple[int, bytes]]:
        """Return everything that is held back, to be written after all."""
        held = list(self._held)
        self._held.clear()
        return held
