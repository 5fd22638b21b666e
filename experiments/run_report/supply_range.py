"""The voltage and the current of each drive's supply over a log.

A weak cable lowers the voltage of one drive, a weak battery that of all.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from logs.files.tick_array import Ticks

Row = dict[str, Any]


class SupplyRange:
    """Owns the extremes of the ticks that were added."""

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints = joints
        self._lowest_v = np.full(len(joints), np.inf)
        self._lowest_s, self._highest_v, self._most_a = np.full((3, len(joints)), np.nan)

    def add(self, ticks: Ticks) -> None:
        volts = ticks["bus_voltage_v"]
        if not len(volts):
            return
        lowest = np.argmin(np.where(np.isnan(volts), np.inf, volts), axis=0)
        lows_v, stamps_s = volts[lowest, np.arange(len(lowest))], ticks["stamp_s"][lowest]
        lower = lows_v < self._lowest_v
        self._lowest_v, self._lowest_s = np.where(lower, [lows_v, stamps_s], [self._lowest_v, self._lowest_s])
        self._highest_v = np.fmax(self._highest_v, np.fmax.reduce(volts))
        self._most_a = np.fmax(self._most_a, np.fmax.reduce(ticks["bus_current_a"]))

    def rows(self) -> list[Row]:
        """Return a row for each drive that reported a voltage; the current is None where it reported none."""
        numbers = (self._lowest_v, self._lowest_s, self._highest_v, self._most_a)
        values = zip(self._joints, *(each.tolist() for each in numbers), strict=True)
        return [
            {"joint": joint, "lowest_v": lowest_v, "lowest_stamp_s": stamp_s, "highest_v": highest_v}
            | {"most_a": None if np.isnan(most_a) else most_a}
            for joint, lowest_v, stamp_s, highest_v, most_a in values
            if np.isfinite(lowest_v)
        ]
