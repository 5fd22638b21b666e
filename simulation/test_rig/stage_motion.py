"""How a stage covers a distance: driven by a controller with ramps, or pushed by hand with uneven speed and rests.

A hand pushes at one speed for a few millimetres and at another for the next ones, changes between them with the
acceleration of an arm, and sometimes rests. Its speeds, distances and rests are assumptions; none was measured.
"""

from bisect import bisect_right
from dataclasses import dataclass
from math import sqrt
from random import Random
from typing import NamedTuple, Protocol


class Motion(Protocol):
    """A motion from 0 to a distance."""

    duration_s: float

    def path_m(self, time_s: float) -> float:
        """Return the distance covered since the start: 0 before it, all after the end."""


class RampedMotion:
    """A trapezoid of speed, or a triangle where the distance is short."""

    def __init__(self, path_m: float, speed_m_s: float, acceleration_m_s2: float) -> None:
        self._end_m, self._acceleration_m_s2 = path_m, acceleration_m_s2
        self._peak_m_s = min(speed_m_s, sqrt(path_m * acceleration_m_s2))
        self._ramp_s = self._peak_m_s / acceleration_m_s2
        self.duration_s = path_m / self._peak_m_s + self._ramp_s if self._peak_m_s else 0.0

    def path_m(self, time_s: float) -> float:
        if time_s <= 0.0:
            return 0.0
        left_s = max(0.0, self.duration_s - time_s)
        if left_s < self._ramp_s:
            return self._end_m - self._acceleration_m_s2 * left_s * left_s / 2.0
        if time_s < self._ramp_s:
            return self._acceleration_m_s2 * time_s * time_s / 2.0
        return self._peak_m_s * (time_s - self._ramp_s / 2.0)


@dataclass(frozen=True)
class ManualMotionParameters:
    slowest_m_s: float = 0.05
    fastest_m_s: float = 0.2
    acceleration_m_s2: float = 4.0
    shortest_m: float = 0.002  # distance at one speed
    longest_m: float = 0.01
    rest_fraction: float = 0.25  # of the changes of speed that begin with a rest
    shortest_rest_s: float = 0.05
    longest_rest_s: float = 0.5


class _Knot(NamedTuple):
    """The start of a piece of constant acceleration."""

    time_s: float
    position_m: float
    speed_m_s: float
    acceleration_m_s2: float


class ManualMotion:
    """An uneven motion, drawn anew for each stroke."""

    def __init__(self, path_m: float, hand: ManualMotionParameters, random: Random) -> None:
        self._end_m, self._hand = path_m, hand
        self._knots = [_Knot(0.0, 0.0, 0.0, 0.0)]
        while self._remaining_m() > 1e-9:
            self._push(random)
        self.duration_s = self._knots[-1].time_s
        self._times_s = [knot.time_s for knot in self._knots]

    def _remaining_m(self) -> float:
        return self._end_m - self._knots[-1].position_m

    def _push(self, random: Random) -> None:
        """Add a piece at another speed, or the rest of the distance."""
        hand = self._hand
        speed_m_s = random.uniform(hand.slowest_m_s, hand.fastest_m_s)
        distance_m = random.uniform(hand.shortest_m, hand.longest_m)
        braking_m = hand.fastest_m_s**2 / (2.0 * hand.acceleration_m_s2)
        if self._remaining_m() < distance_m + 3.0 * braking_m:
            self._finish(speed_m_s)
            return
        self._change_speed(speed_m_s)
        self._continue(distance_m)
        if random.random() < hand.rest_fraction:
            self._change_speed(0.0)
            rest_s = random.uniform(hand.shortest_rest_s, hand.longest_rest_s)
            self._knots.append(self._knots[-1]._replace(time_s=self._knots[-1].time_s + rest_s))

    def _finish(self, speed_m_s: float) -> None:
        """Cover the rest, at most at the speed from which it can still stop at the end."""
        a, before_m_s = self._hand.acceleration_m_s2, self._knots[-1].speed_m_s
        speed_m_s = min(speed_m_s, sqrt(a * self._remaining_m() + before_m_s**2 / 2.0))
        self._change_speed(speed_m_s)
        self._continue(max(0.0, self._remaining_m() - speed_m_s**2 / (2.0 * a)))
        self._change_speed(0.0)
        self._knots[-1] = self._knots[-1]._replace(position_m=self._end_m)

    def _change_speed(self, to_m_s: float) -> None:
        time_s, position_m, speed_m_s, _ = self._knots[-1]
        lasts_s = abs(to_m_s - speed_m_s) / self._hand.acceleration_m_s2
        if lasts_s:
            self._knots[-1] = _Knot(time_s, position_m, speed_m_s, (to_m_s - speed_m_s) / lasts_s)
            self._knots.append(_Knot(time_s + lasts_s, position_m + lasts_s * (speed_m_s + to_m_s) / 2.0, to_m_s, 0.0))

    def _continue(self, path_m: float) -> None:
        time_s, position_m, speed_m_s, _ = self._knots[-1]
        self._knots.append(_Knot(time_s + path_m / speed_m_s, position_m + path_m, speed_m_s, 0.0))

    def path_m(self, time_s: float) -> float:
        if time_s <= 0.0:
            return 0.0
        if time_s >= self.duration_s:
            return self._end_m
        start_s, position_m, speed_m_s, acceleration_m_s2 = self._knots[bisect_right(self._times_s, time_s) - 1]
        since_s = time_s - start_s
        return position_m + since_s * (speed_m_s + acceleration_m_s2 * since_s / 2.0)
