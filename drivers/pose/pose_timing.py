"""Converts a camera's time stamps to this computer's clock, and extrapolates the body's position to now.

The motion-capture program stamps its frames with its own clock. The offset between the clocks is at most the smallest
recent difference of arrival and sending: all other frames waited in a network, or until the next tick read them. (NTP
filters its samples by the same least delay; the part that delays every frame stays unknown.) Between frames the body
is assumed to keep its velocity over the last few frames.
"""

from collections import deque
from math import inf

from control.records import NEVER_S, UNKNOWN

WINDOW_S = 10.0  # two clocks that differ by 50 ppm drift apart by half a millisecond in it
RESTARTED_S = 1.0  # a delay that exceeds the least one by more shows that the sender's clock was set
VELOCITY_SPAN_S = 0.016  # between the two positions of a velocity, two frames of 120 Hz: 0.1 mm of noise makes 9 mm/s
LONGEST_EXTRAPOLATION_S = 0.1
JUMP_M = 0.03  # from frame to frame; the robot cannot move so fast, so the velocity is unknown


class LeastDelay:
    """Estimates the offset of the sender's clock. Owns the least delays of this window and of the one before."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._least_s = self._before_s = inf
        self._since_s = NEVER_S

    def update(self, arrival_s: float, sent_s: float) -> float:
        """Return the offset that converts the sender's clock to this computer's."""
        delay_s = arrival_s - sent_s
        if delay_s - min(self._least_s, self._before_s) > RESTARTED_S:
            self.reset()
        if arrival_s - self._since_s > WINDOW_S:
            self._before_s, self._least_s, self._since_s = self._least_s, inf, arrival_s
        self._least_s = min(self._least_s, delay_s)
        return min(self._least_s, self._before_s)


class PoseForecast:
    """Extrapolates the position along the track. Owns the recent positions, with their times."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._positions: deque[tuple[float, float]] = deque()

    def add(self, stamp_s: float, x_m: float) -> bool:
        """Add a position; return whether it is plausible after the previous one. If not, it becomes the first."""
        positions = self._positions
        follows = bool(positions) and stamp_s > positions[-1][0] and abs(x_m - positions[-1][1]) <= JUMP_M
        if not follows:
            positions.clear()
        positions.append((stamp_s, x_m))
        while len(positions) > 2 and stamp_s - positions[1][0] >= VELOCITY_SPAN_S:
            positions.popleft()
        return follows

    def at(self, now_s: float) -> float:
        """Return the position in metres at `now_s`; NaN before the first one."""
        if not self._positions:
            return UNKNOWN
        (first_s, first_m), (last_s, last_m) = self._positions[0], self._positions[-1]
        ahead_s, span_s = min(now_s - last_s, LONGEST_EXTRAPOLATION_S), last_s - first_s
        if ahead_s <= 0.0 or not VELOCITY_SPAN_S / 2.0 <= span_s <= 2.0 * LONGEST_EXTRAPOLATION_S:
            return last_m
        return last_m + (last_m - first_m) / span_s * ahead_s
