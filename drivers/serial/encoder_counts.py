"""Places from the lines of an encoder's counter: what is a count, and which of them are believed.

A line is a whole number in ASCII, behind a label where one is configured (`x:1234`, `x=1234`, `x 1234`). One that is no
count, or that nothing on a rail could have come to since the one before, is garbled. A count that leaps and stays there
is believed from its second line on: a counter that was restarted begins at zero.
"""

from __future__ import annotations

import re
from math import isfinite

from control.records import NEVER_S, UNKNOWN

FASTEST_M_S = 2.0  # four times what the flippers' tips reach
SLACK_M = 0.01  # of lines that arrive together


class EncoderCounts:
    """Owns the last place that was believed, the one that was doubted, and the counters, which only grow."""

    def __init__(self, metres_per_count: float, label: str = "", origin_m: float = 0.0) -> None:
        """`origin_m`: the counter's place where the place is zero."""
        self._metres_per_count, self._origin_m = metres_per_count, origin_m
        separator = rb"\s*[:=]?" if label else rb""
        self._line = re.compile(rb"\s*" + re.escape(label.encode()) + separator + rb"\s*([+-]?\d{1,15})\s*")
        self.believed = self.garbled = self.leaps = 0
        self.reset()

    def reset(self) -> None:
        self._position_m = self._doubted_m = UNKNOWN
        self._stamp_s = NEVER_S

    def decode(self, line: bytes) -> float | None:
        """The place, believed or not; None where the line is no count."""
        count = self._line.fullmatch(line)
        return int(count[1]) * self._metres_per_count - self._origin_m if count else None

    def take(self, line: bytes, stamp_s: float) -> float | None:
        """The place, where it is believed."""
        position_m = self.decode(line)
        if position_m is None or not self._is_believed(position_m, stamp_s):
            self.garbled += 1
            self._doubted_m = UNKNOWN if position_m is None else position_m
            return None
        self.believed += 1
        self._position_m, self._stamp_s = position_m, stamp_s
        return position_m

    def _is_believed(self, position_m: float, stamp_s: float) -> bool:
        if not isfinite(self._position_m):
            return True
        if abs(position_m - self._position_m) <= FASTEST_M_S * (stamp_s - self._stamp_s) + SLACK_M:
            return True
        stays = abs(position_m - self._doubted_m) <= SLACK_M
        self.leaps += stays
        return stays
