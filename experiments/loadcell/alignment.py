"""Forces and places on one time: by how much later forces are stamped, and how mud bears at another speed.

Forces are held against the mean places of the time over which each was converted, `lag` earlier. A coefficient belongs
to a speed: mud bears g = 1 + r ((v/v_0)^0.4 - 1) times what it bears at the one that was set. All trials have the same
devices and about the same clay, so lag and r are found in each trial and then fitted again near their median: the lag
in insertions, r in shears, which tell nothing else than how the force follows the speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite, nan, sqrt
from statistics import median, stdev
from typing import NamedTuple

import numpy as np

from experiments.loadcell.contact import Profile
from experiments.loadcell.curve_fit import Array
from experiments.loadcell.motion import RATE_EXPONENT, StageSettings
from experiments.loadcell.stage_track import StageTrack

RESTING_FRACTION = 0.12  # of the set speed, below which the stage rests
LEAST_LAG_UNCERTAINTY_S = 2e-3  # from trial to trial: lines wait until they are asked for
LEAST_RATE_UNCERTAINTY = 0.03  # mud follows the speed a millimetre late
MEDIAN_ERROR = 1.25  # times that of a mean
HANGING_TOGETHER = 2.0  # times the standard error of independent samples


class Alignment(NamedTuple):
    """With one standard error each; a lag is NaN where a trial does not tell it."""

    lag_s: float
    rate_fraction: float  # r
    lag_uncertainty_s: float
    rate_uncertainty: float


WIDE = Alignment(0.0, 0.08, 0.03, 0.08)  # adapters and filters; 5 to 20 % a decade, as clay practice has it


class PlacedProfile:
    """Forces with the places that belong to them; the track is turned so that the stroke goes forward."""

    def __init__(self, profile: Profile, track: StageTrack, settings: StageSettings) -> None:
        self.profile, self.settings = profile, settings
        self.track = track if track.farthest_m > 0.0 else track.turned()
        self.period_s = float(np.median(np.diff(profile.times_s)))

    def mean_positions_m(self, lag_s: float) -> Array:
        """NaN where the encoder does not tell."""
        return self.track.mean_positions_m(self.profile.times_s - lag_s, self.period_s)

    def speeds_m_s(self, lag_s: float) -> Array:
        return self.track.speeds_m_s(self.profile.times_s - lag_s, self.period_s)

    def grips(self, lag_s: float, rate_fraction: float) -> Array:
        return 1.0 + rate_fraction * self.quickness(lag_s)

    def quickness(self, lag_s: float) -> Array:
        """(v/v_0)^0.4 - 1."""
        fractions = np.maximum(np.abs(self.speeds_m_s(lag_s)) / self.settings.speed_m_s, RESTING_FRACTION)
        return np.asarray(fractions**RATE_EXPONENT - 1.0, dtype=np.float64)


def rate_of(forces_n: Array, quickness: Array) -> Alignment:
    """r of a force that is constant but for the speed, held against what is expected of clay."""
    columns = np.stack([np.ones_like(forces_n), quickness], 1)
    (force_n, slope_n), *_ = np.linalg.lstsq(columns, forces_n, rcond=None)
    apart_n = forces_n - columns @ np.array([force_n, slope_n])
    spread = float(np.sum((quickness - np.mean(quickness)) ** 2))
    uncertainty = inf
    if spread > 0.0 and force_n > 0.0:
        uncertainty = HANGING_TOGETHER * sqrt(float(np.mean(apart_n**2)) / spread) / float(force_n)
    reported, own = 1.0 / WIDE.rate_uncertainty**2, 1.0 / max(uncertainty, 1e-6) ** 2
    rate = (WIDE.rate_fraction * reported + (float(slope_n / force_n) * own if own > 0.0 else 0.0)) / (reported + own)
    return Alignment(nan, rate, inf, 1.0 / sqrt(reported + own))


def common_alignment(reported: Sequence[Alignment]) -> Alignment:
    """Of all trials: the medians, and what they scatter."""
    insertions = [each for each in reported if isfinite(each.lag_s)]
    rated = [each for each in reported if not isfinite(each.lag_s)] or insertions
    lag_s, lag_uncertainty_s = _common([(each.lag_s, each.lag_uncertainty_s) for each in insertions], WIDE[0], WIDE[2])
    rate, rate_uncertainty = _common([(each.rate_fraction, each.rate_uncertainty) for each in rated], WIDE[1], WIDE[3])
    return Alignment(
        lag_s, rate, max(lag_uncertainty_s, LEAST_LAG_UNCERTAINTY_S), max(rate_uncertainty, LEAST_RATE_UNCERTAINTY)
    )


def _common(reported: Sequence[tuple[float, float]], otherwise: float, uncertainty: float) -> tuple[float, float]:
    if not reported:
        return otherwise, uncertainty
    values, uncertainties = [value for value, _ in reported], [each for _, each in reported]
    scatter = stdev(values) if len(values) > 2 else 0.0
    return median(values), MEDIAN_ERROR * max(scatter, median(uncertainties)) / sqrt(len(values))
