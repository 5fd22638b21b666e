"""The ticker paces the loop; only this module sleeps.

Deadlines are absolute, start + n · period, so the rate does not drift with the work done in a tick. A deadline that
is missed by a whole period or more is skipped and counted, and no tick makes up for it: two control ticks in a row on
one stale sample are worse than a gap.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

from control.rate import PERIOD_S


class Tick(NamedTuple):
    now_s: float
    late_s: float  # delay of the wake-up after the deadline
    number: int  # of the deadline, counting missed ones
    missed: int  # deadlines skipped before this tick


class Ticker:
    def __init__(
        self,
        period_s: float = PERIOD_S,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.period_s = period_s
        self._clock = clock
        self._sleep = sleep
        self._start_s = clock()  # the first deadline is one period later
        self._number = 0

    def wait(self) -> Tick:
        """Sleep until the next deadline."""
        self._number += 1
        deadline_s = self._start_s + self._number * self.period_s
        now_s = self._clock()
        while now_s < deadline_s:
            self._sleep(deadline_s - now_s)
            now_s = self._clock()
        late_s = now_s - deadline_s
        missed = int(late_s / self.period_s)
        self._number += missed
        return Tick(now_s, late_s, self._number, missed)
