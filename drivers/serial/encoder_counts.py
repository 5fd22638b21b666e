"""Positions from the lines of an encoder's counter: decodes each count and rejects implausible ones.

A line is an integer in ASCII, after a label where one is configured (`x:1234`, `x=1234`, `x 1234`). A line without a
count is malformed, and so is a count that no body on a rail can have reached since the count before. A count that jumps
and stays there is accepted from its second line on, because a counter that was restarted begins at zero.
"""

import re
from math import isfinite

from control.records import NEVER_S, UNKNOWN

FASTEST_M_S = 2.0  # four times what the flippers' tips reach
SLACK_M = 0.01  # for lines that arrive together


class EncoderCounts:
    """Owns the last accepted position, the last rejected one, and the counters, which only grow."""

    def __init__(self, metres_per_count: float, label: str = "", origin_m: float = 0.0) -> None:
        """`origin_m` is the counter's position where the returned position is zero."""
        self._metres_per_count, self._origin_m = metres_per_count, origin_m
        separator = rb"\s*[:=]?" if label else rb""
        self._line = re.compile(rb"\s*" + re.escape(label.encode()) + separator + rb"\s*([+-]?\d{1,15})\s*")
        self.accepted = self.malformed = self.jumps = 0
        self.reset()

    def reset(self) -> None:
        self._position_m = self._rejected_m = UNKNOWN
        self._stamp_s = NEVER_S

    def decode(self, line: bytes) -> float | None:
        """Return the position, accepted or not; None where the line is no count."""
        count = self._line.fullmatch(line)
        return int(count[1]) * self._metres_per_count - self._origin_m if count else None

    def accept(self, line: bytes, stamp_s: float) -> float | None:
        """Return the position where it is plausible, else None."""
        position_m = self.decode(line)
        if position_m is None or not self._is_plausible(position_m, stamp_s):
            self.malformed += 1
            self._rejected_m = UNKNOWN if position_m is None else position_m
            return None
        self.accepted += 1
        self._position_m, self._rejected_m, self._stamp_s = position_m, UNKNOWN, stamp_s
        return position_m

    def _is_plausible(self, position_m: float, stamp_s: float) -> bool:
        if not isfinite(self._position_m):
            return True
        if abs(position_m - self._position_m) <= FASTEST_M_S * (stamp_s - self._stamp_s) + SLACK_M:
            return True
        stays = abs(position_m - self._rejected_m) <= SLACK_M
        self.jumps += stays
        return stays
