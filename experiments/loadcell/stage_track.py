"""Where the stage was while the load cell converted: places of its encoder, brought to the times of the forces.

Both devices stamp their lines at the computer, at different rates. A force is a mean over the time since the one
before it, so it belongs to the mean place over that time, of straight lines between the encoder's lines: with an
acceleration a and lines Δt apart they are within a Δt²/8 of the truth, at 100 lines/s and 2 m/s² 25 µm. How much later
a force is stamped than its place (adapters, filters) is the `lag`, which the strokes themselves tell. Over a gap
between lines the place is known where the stage stood, and else it is not: NaN.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from experiments.loadcell.curve_fit import Array

LONGEST_GAP_S, LONGEST_GAP = 0.06, 2.5  # between lines that are joined; in times between lines
STANDING_M = 2e-4  # between the ends of a gap over which the stage stood
LEAST_PLACES = 8
LEAP_M, LEAP_FRACTION = 2e-4, 0.25


class Places(NamedTuple):
    """As the encoder told them."""

    times_s: Array
    positions_m: Array


class StageTrack:
    """Places against time, a first place being zero."""

    def __init__(self, places: Places) -> None:
        self._times_s, self._positions_m = places.times_s, without_leaps(places.positions_m - places.positions_m[0])
        steps_s, means_m = np.diff(self._times_s), (self._positions_m[1:] + self._positions_m[:-1]) / 2.0
        self._sums = np.concatenate([[0.0], np.cumsum(steps_s * means_m)])  # integral of the place
        longest_s = max(LONGEST_GAP_S, LONGEST_GAP * float(np.median(steps_s)))
        unknown = (steps_s > longest_s) & (np.abs(np.diff(self._positions_m)) > STANDING_M)
        self._unknown_s = np.concatenate([[0.0], np.cumsum(steps_s * unknown)])

    def turned(self) -> StageTrack:
        """The same the other way round."""
        return StageTrack(Places(self._times_s, -self._positions_m))

    @property
    def farthest_m(self) -> float:
        """From its first place, with its sign."""
        return float(self._positions_m[int(np.argmax(np.abs(self._positions_m)))])

    @property
    def interpolation_error_m(self) -> float:
        """Bound of what straight lines between places leave, as their bends tell: a Δt²/8."""
        bends_m = np.abs(np.diff(self._positions_m, 2))
        return float(np.quantile(bends_m, 0.99)) / 8.0 if len(bends_m) else 0.0

    def positions_m(self, times_s: Array) -> Array:
        return np.interp(times_s, self._times_s, self._positions_m)

    def mean_positions_m(self, until_s: Array, over_s: float) -> Array:
        """Over as long before each time; NaN where the encoder does not tell."""
        mean_m = (self._integral(until_s) - self._integral(until_s - over_s)) / over_s
        gaps_s = np.interp(until_s, self._times_s, self._unknown_s)
        gaps_s -= np.interp(until_s - over_s, self._times_s, self._unknown_s)
        reported = (until_s - over_s >= self._times_s[0]) & (until_s <= self._times_s[-1]) & (gaps_s <= 0.0)
        return np.where(reported, mean_m, np.nan)

    def speeds_m_s(self, until_s: Array, over_s: float) -> Array:
        return (self.positions_m(until_s) - self.positions_m(until_s - over_s)) / over_s

    def _integral(self, times_s: Array) -> Array:
        place = np.clip(np.searchsorted(self._times_s, times_s) - 1, 0, len(self._times_s) - 2)
        since_s = times_s - self._times_s[place]
        return self._sums[place] + since_s * (self._positions_m[place] + self.positions_m(times_s)) / 2.0


def without_leaps(positions_m: Array) -> Array:
    """Single places beside a line on which two on each side agree: a digit that was garbled into another."""
    if len(positions_m) < 5:
        return positions_m
    near_m, far_m = (positions_m[1:-3] + positions_m[3:-1]) / 2.0, (positions_m[:-4] + positions_m[4:]) / 2.0
    apart_m = np.abs(positions_m[2:-2] - near_m)
    leaps = (apart_m > LEAP_M) & (np.abs(near_m - far_m) < LEAP_FRACTION * apart_m)
    fixed = positions_m.copy()
    fixed[2:-2][leaps] = near_m[leaps]
    return fixed
