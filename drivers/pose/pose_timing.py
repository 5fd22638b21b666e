"""When a pose was true, by this computer's clock, and where the body is by now.

A camera's program stamps its frames with a clock of its own. What separates that clock from ours is at most what the
quickest frame of late shows, arrival minus sending: all others were held up somewhere, in a network or until the next
tick read them (the least delay, as NTP filters its samples; what it cannot show is the part that every frame takes).
Between frames a body goes on as it went over the last few.
"""

from __future__ import annotations

from collections import deque
from math import inf

from control.records import NEVER_S, UNKNOWN

WINDOW_S = 10.0  # in which clocks of 50 ppm part by half a millisecond
RESTARTED_S = 1.0  # a frame later than the quickest by so much comes from a clock that was set
SPEED_S = 0.016  # over which a speed is taken, two frames of 120 Hz: with 0.1 mm of noise it is known to 9 mm/s
LONGEST_S = 0.1  # that a body is thought to go on as it went
LEAP_M = 0.03  # from frame to frame: no body of ours, so nothing is known of its speed


class LeastDelay:
    """Owns the quickest frames of this window and of the one before."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._least_s = self._before_s = inf
        self._since_s = NEVER_S

    def update(self, arrival_s: float, sent_s: float) -> float:
        """What to add to the sender's clock to have ours."""
        delay_s = arrival_s - sent_s
        if delay_s - min(self._least_s, self._before_s) > RESTARTED_S:
            self.reset()
        if arrival_s - self._since_s > WINDOW_S:
            self._before_s, self._least_s, self._since_s = self._least_s, inf, arrival_s
        self._least_s = min(self._least_s, delay_s)
        return min(self._least_s, self._before_s)


class PoseForecast:
    """Owns the places of late."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._places: deque[tuple[float, float]] = deque()

    def add(self, stamp_s: float, x_m: float) -> bool:
        """Whether the body can have come there from the place before; else this one is the first."""
        places = self._places
        follows = bool(places) and stamp_s > places[-1][0] and abs(x_m - places[-1][1]) <= LEAP_M
        if not follows:
            places.clear()
        places.append((stamp_s, x_m))
        while len(places) > 2 and stamp_s - places[1][0] >= SPEED_S:
            places.popleft()
        return follows

    def at(self, now_s: float) -> float:
        if not self._places:
            return UNKNOWN
        (first_s, first_m), (last_s, last_m) = self._places[0], self._places[-1]
        ahead_s = min(now_s - last_s, LONGEST_S)
        if last_s - first_s < SPEED_S / 2.0 or last_s - first_s > 2.0 * LONGEST_S or ahead_s <= 0.0:
            return last_m
        return last_m + (last_m - first_m) / (last_s - first_s) * ahead_s
