"""Converts the stamps of frames from the wall clock to the monotonic clock, also when the wall clock is stepped.

The kernel and python-can stamp frames with the wall clock, which an operator, NTP or GPS may step at any time. Where
the offset between the clocks has moved by more than STEP_S since the last look, the stamps of one read belong to either
side of the step. They are then worth nothing, and a frame counts as having arrived when it was read. Slewing moves the
offset by 0.5 ms per second at most, so reads in every tick see no step in it.
"""

import time
from collections.abc import Callable

from control.records import NEVER_S

STEP_S = 0.001


class StampClock:
    """Owns the offset between the clocks."""

    def __init__(
        self, monotonic: Callable[[], float] = time.monotonic, wall_clock: Callable[[], float] = time.time
    ) -> None:
        self._monotonic, self._wall_clock = monotonic, wall_clock
        self._offset_s = monotonic() - wall_clock()

    def offset_s(self) -> float:
        """Return the monotonic clock minus the wall clock; NEVER_S where that has moved since the last call.

        A stamp plus this offset is a stamp of the monotonic clock, or NEVER_S.
        """
        before_s, self._offset_s = self._offset_s, self._monotonic() - self._wall_clock()
        return self._offset_s if -STEP_S < self._offset_s - before_s < STEP_S else NEVER_S
