"""Positions of the stage from its encoder, on the time axis of the forces.

Both devices stamp their lines when they arrive at the computer, at different rates. A force is a mean over the time
since the sample before it, so it belongs to the mean position over that time. Between the encoder's lines the position
is interpolated: with an acceleration a and lines Δt apart it is within a Δt²/8 of the truth, 25 µm at 100 lines/s and
2 m/s². Over a longer gap the position is known only where the stage stood still, and else it is NaN.

Forces are stamped later than positions by a lag (adapters, filters). A coefficient belongs to a speed: mud resists
g = 1 + r ((v/v_0)^0.4 - 1) times as much at v as at the set speed v_0. Lag and r are fitted in each trial and then
again near the median of all trials, which have the same devices and about the same clay: the lag in insertions, r in
shears.
"""

from collections.abc import Sequence
from math import inf, isfinite, nan, sqrt
from statistics import median, stdev

import numpy as np

from experiments.loadcell.curve_fit import Array
from experiments.loadcell.strokes import RATE_EXPONENT, Alignment, Profile, StagePositions, StageSettings

LONGEST_GAP_S, LONGEST_GAP = 0.06, 2.5  # between lines that are joined; the second in periods of the encoder
STANDING_M = 2e-4  # between the ends of a gap in which the stage stood still
LEAP_M, LEAP_FRACTION = 2e-4, 0.25
RESTING_FRACTION = 0.12  # of the set speed, below which the stage rests
LEAST_LAG_UNCERTAINTY_S = 2e-3  # between trials: lines wait until they are read
LEAST_RATE_UNCERTAINTY = 0.03  # mud follows the speed a millimetre late
MEDIAN_ERROR = 1.25  # standard error of a median over that of a mean
CORRELATION = 2.0  # standard error of correlated samples over that of independent ones
WIDE = Alignment(0.0, 0.08, 0.03, 0.08)  # adapters and filters; 5 to 20 % a decade, as clay practice has it


class PositionedProfile:
    """Forces with their positions, which are relative to the first one and positive in the direction of the stroke."""

    def __init__(self, profile: Profile, lines: StagePositions, settings: StageSettings) -> None:
        self.profile, self.settings = profile, settings
        self.period_s = float(np.median(np.diff(profile.times_s)))
        positions_m = without_leaps(lines.positions_m - lines.positions_m[0])
        farthest_m = positions_m[int(np.argmax(np.abs(positions_m)))]
        self._times_s, self._positions_m = lines.times_s, positions_m if farthest_m > 0.0 else -positions_m
        steps_s, means_m = np.diff(self._times_s), (self._positions_m[1:] + self._positions_m[:-1]) / 2.0
        self._sums = np.concatenate([[0.0], np.cumsum(steps_s * means_m)])  # integral of the position
        longest_s = max(LONGEST_GAP_S, LONGEST_GAP * float(np.median(steps_s)))
        unknown = (steps_s > longest_s) & (np.abs(np.diff(self._positions_m)) > STANDING_M)
        self._unknown_s = np.concatenate([[0.0], np.cumsum(steps_s * unknown)])

    @property
    def interpolation_error_m(self) -> float:
        """The bound a Δt²/8 of the error of interpolation, from the measured accelerations."""
        bends_m = np.abs(np.diff(self._positions_m, 2))
        return float(np.quantile(bends_m, 0.99)) / 8.0 if len(bends_m) else 0.0

    def positions_m(self, times_s: Array) -> Array:
        return np.interp(times_s, self._times_s, self._positions_m)

    def mean_positions_m(self, lag_s: float) -> Array:
        """Return the position of each force, the mean over the period before it; NaN where it is unknown."""
        until_s, over_s = self.profile.times_s - lag_s, self.period_s
        mean_m = (self._integral(until_s) - self._integral(until_s - over_s)) / over_s
        gaps_s = np.interp(until_s, self._times_s, self._unknown_s)
        gaps_s -= np.interp(until_s - over_s, self._times_s, self._unknown_s)
        known = (until_s - over_s >= self._times_s[0]) & (until_s <= self._times_s[-1]) & (gaps_s <= 0.0)
        return np.where(known, mean_m, np.nan)

    def _integral(self, times_s: Array) -> Array:
        line = np.clip(np.searchsorted(self._times_s, times_s) - 1, 0, len(self._times_s) - 2)
        since_s = times_s - self._times_s[line]
        return self._sums[line] + since_s * (self._positions_m[line] + self.positions_m(times_s)) / 2.0

    def speeds_m_s(self, lag_s: float) -> Array:
        until_s = self.profile.times_s - lag_s
        return (self.positions_m(until_s) - self.positions_m(until_s - self.period_s)) / self.period_s

    def speed_terms(self, lag_s: float) -> Array:
        """Return (v/v_0)^0.4 - 1 of each force."""
        fractions = np.maximum(np.abs(self.speeds_m_s(lag_s)) / self.settings.speed_m_s, RESTING_FRACTION)
        return np.asarray(fractions**RATE_EXPONENT - 1.0, dtype=np.float64)

    def speed_factors(self, lag_s: float, rate_fraction: float) -> Array:
        """Return g of each force."""
        return 1.0 + rate_fraction * self.speed_terms(lag_s)


def without_leaps(positions_m: Array) -> Array:
    """Replace single positions off a line on which two neighbours to each side agree, such as garbled digits."""
    if len(positions_m) < 5:
        return positions_m
    near_m, far_m = (positions_m[1:-3] + positions_m[3:-1]) / 2.0, (positions_m[:-4] + positions_m[4:]) / 2.0
    apart_m = np.abs(positions_m[2:-2] - near_m)
    leaps = (apart_m > LEAP_M) & (np.abs(near_m - far_m) < LEAP_FRACTION * apart_m)
    fixed = positions_m.copy()
    fixed[2:-2][leaps] = near_m[leaps]
    return fixed


def fit_rate(forces_n: Array, speed_terms: Array) -> Alignment:
    """Fit r to a force that is constant except for the speed, with the expected r of clay as a prior."""
    columns = np.stack([np.ones_like(forces_n), speed_terms], 1)
    (force_n, slope_n), *_ = np.linalg.lstsq(columns, forces_n, rcond=None)
    apart_n = forces_n - columns @ np.array([force_n, slope_n])
    spread = float(np.sum((speed_terms - np.mean(speed_terms)) ** 2))
    uncertainty = inf
    if spread > 0.0 and force_n > 0.0:
        uncertainty = CORRELATION * sqrt(float(np.mean(apart_n**2)) / spread) / float(force_n)
    prior, own = 1.0 / WIDE.rate_uncertainty**2, 1.0 / max(uncertainty, 1e-6) ** 2
    rate = (WIDE.rate_fraction * prior + (float(slope_n / force_n) * own if own > 0.0 else 0.0)) / (prior + own)
    return Alignment(nan, rate, inf, 1.0 / sqrt(prior + own))


def common_alignment(trials: Sequence[Alignment]) -> Alignment:
    """Return the medians of all trials, with their standard errors."""
    insertions = [each for each in trials if isfinite(each.lag_s)]
    rated = [each for each in trials if not isfinite(each.lag_s)] or insertions
    lag_s, lag_error_s = WIDE.lag_s, WIDE.lag_uncertainty_s
    rate, rate_error = WIDE.rate_fraction, WIDE.rate_uncertainty
    if insertions:
        lag_s, lag_error_s = _median([(each.lag_s, each.lag_uncertainty_s) for each in insertions])
    if rated:
        rate, rate_error = _median([(each.rate_fraction, each.rate_uncertainty) for each in rated])
    return Alignment(lag_s, rate, max(lag_error_s, LEAST_LAG_UNCERTAINTY_S), max(rate_error, LEAST_RATE_UNCERTAINTY))


def _median(values_with_errors: Sequence[tuple[float, float]]) -> tuple[float, float]:
    values, errors = zip(*values_with_errors, strict=True)
    scatter = stdev(values) if len(values) > 2 else 0.0
    return median(values), MEDIAN_ERROR * max(scatter, median(errors)) / sqrt(len(values))
