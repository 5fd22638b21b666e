"""At rest, when no torque is on, one tick in many goes to the disk; what leads to torque is there in full.

A robot that waits for its person would fill its card with rows that say nothing. So the log's writer thins the ticks
of the modes without torque, and keeps those that it leaves out in memory for a while. When the mode changes, or torque
comes on, the kept ones are written after all: the seconds before are as complete as what follows. They stand in the
file after thinned rows of the same time, and the readers sort by the tick's number. A run that ends, however it ends,
counts as such a change. Strides and events are never thinned.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from control.modes import ENERGISED
from firmware_host.log.rows import FORMAT_OF, TICK, TICK_KIND
from firmware_host.ticker import RATE_HZ


def _place(name: str) -> int:
    """Of a field in a tick's bytes."""
    place = 4
    for field in TICK.fields:
        if field.name == name:
            return place
        place += field.count * struct.calcsize(f"<{FORMAT_OF[field.kind]}")
    raise KeyError(name)


MODE, NUMBER = _place("mode"), _place("tick")


class Thinned(NamedTuple):
    rows: list[tuple[int, bytes]]  # to be written
    notice: str  # of a beginning or an end of the thinning, or empty


class RestThinning:
    """Owns the ticks that are held back."""

    def __init__(self, rest_hz: float, full_s: float) -> None:
        self._every = max(1, round(RATE_HZ / rest_hz)) if rest_hz > 0.0 else 1
        self._full_ticks = round(full_s * RATE_HZ)
        self._held: deque[tuple[int, bytes]] = deque(maxlen=self._full_ticks)
        self.reset()

    def reset(self) -> None:
        self._held.clear()
        self._mode = -1
        self._rested = 0  # ticks since torque or a change of mode
        self._resting = False

    def thin(self, rows: Iterable[tuple[int, bytes]]) -> Thinned:
        """The rows to write, in the order of their coming."""
        if self._every == 1:
            return Thinned(list(rows), "")
        written: list[tuple[int, bytes]] = []
        notice = ""
        for row in rows:
            if row[0] == TICK_KIND and len(row[1]) > MODE:
                notice = self._add_tick(row, written) or notice
            else:
                written.append(row)
        return Thinned(written, notice)

    def _add_tick(self, row: tuple[int, bytes], written: list[tuple[int, bytes]]) -> str:
        mode = row[1][MODE]
        stirred = mode in ENERGISED or mode != self._mode
        self._mode = mode
        self._rested = 0 if stirred else self._rested + 1
        was_resting, self._resting = self._resting, self._rested > self._full_ticks
        if was_resting and not self._resting:
            held = self.release()
            written += held
            written.append(row)
            return f"end of the rest: the {len(held)} ticks held back before this one are written after all"
        (number,) = struct.unpack_from("<I", row[1], NUMBER)
        (self._held if self._resting and number % self._every else written).append(row)
        begins = self._resting and not was_resting
        return f"at rest: of the ticks, one in {self._every} is written from here on" if begins else ""

    def release(self) -> list[tuple[int, bytes]]:
        """Everything that is held back, to be written after all."""
        held = list(self._held)
        self._held.clear()
        return held
