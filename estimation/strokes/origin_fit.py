"""Least squares of y = k x over one stroke, with a standard error that allows for correlated residuals.

A stroke arrives as batches of equal travel, so every piece of the travel counts alike, however long the flipper stayed
there and however often a message was read. Outlying batches count less (Huber 1964, weight min(1, c s / |r|) with
c = HUBER; the scale s is the median absolute residual of a robust first slope and is not updated: a scale that followed
the fit would let many outliers pull it after them). The standard error is Newey and West's (1987), which counts
correlated residuals by their autocovariances,

    var k = [Γ₀ + 2 Σ (1 - j/(L+1)) Γ_j] / (Σ w x²)² · n/(n-2)       Γ_j = Σ g_i g_{i-j},  g = w x r

with r the residuals after a line is subtracted from them: that line is mud's deviation from the law, not scatter. The
error is never less than that of independent residuals, and includes Student's factor. Two of them cover 95 % with
independent residuals, and with twenty batches 87, 72 and 36 % when neighbours correlate by 0.3, 0.6 and 0.9 (measured
in the tests): the slower the noise, the more of it counts as deviation from the law.
"""

from collections.abc import Sequence
from itertools import accumulate
from math import inf, isfinite, sqrt
from operator import mul
from typing import NamedTuple

from control.computing.exact_sum import exact_sum

HUBER = 3.0  # with the usual 1.345 the ends of strokes in mud that deviates from the law would be outliers
NORMAL_MAD = 1.4826
LAGS = 4
ROUNDS = 20
CONVERGED = 1e-7  # of the slope: far below its standard error
MIN_BATCHES = 4
STUDENT = (1.0, 6.48, 2.195, 1.624, 1.417, 1.312, 1.248, 1.207, 1.177, 1.154, 1.137, 1.123, 1.112, 1.102, 1.094)
# t at 97.5 % over 1.96, by degrees of freedom, 1 + 1.3/ν beyond: two standard errors are 95 % however short the stroke


class OriginFit(NamedTuple):
    slope: float
    std_error: float
    square: float = 0.0  # Σ w x²
    variance: float = 0.0  # of the residuals, correlation included: std_error² = Student's factor² · variance / square
    freedom: int = 0


def fit_through_origin(x: Sequence[float], y: Sequence[float]) -> OriginFit | None:
    """Fit the slope; None with too few batches, without a positive regressor, or with numbers too large to square."""
    square = exact_sum([u * u for u in x])
    if len(x) < MIN_BATCHES or not (0.0 < square < inf and max(x) > 0.0 and isfinite(exact_sum(y))):
        return None
    slope, weights = _median_slope(x, y), [1.0] * len(x)
    clip = HUBER * NORMAL_MAD * median([abs(v - slope * u) for u, v in zip(x, y, strict=True)])
    for _ in range(ROUNDS):
        sizes = [abs(v - slope * u) for u, v in zip(x, y, strict=True)]
        weights = [1.0 if size <= clip else clip / size for size in sizes]
        before, slope = slope, _weighted_slope(x, y, weights)
        if abs(slope - before) <= CONVERGED * abs(slope):
            break
    return _evaluated(x, y, weights, slope) if isfinite(slope) else None


def median(values: Sequence[float]) -> float:
    ordered, middle = sorted(values), len(values) // 2
    return ordered[middle] if len(values) % 2 else (ordered[middle - 1] + ordered[middle]) / 2.0


def _median_slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Return a robust first slope, from the batches with more than a third of the largest regressor."""
    large = max(x) / 3.0
    return median([b / a for a, b in zip(x, y, strict=True) if a > large])


def _weighted_slope(x: Sequence[float], y: Sequence[float], weights: Sequence[float]) -> float:
    weighted: list[float] = list(map(mul, weights, x))
    square: float = exact_sum(map(mul, weighted, x))
    slope: float = exact_sum(map(mul, weighted, y)) / square if square > 0.0 else inf
    return slope


def _evaluated(x: Sequence[float], y: Sequence[float], weights: Sequence[float], slope: float) -> OriginFit:
    """Return the fit with Newey and West's standard error, but never less than that of independent residuals.

    Their weighted lags are the squared sums of all L + 1 batches in a row; from few batches they are too small.
    """
    n, (offset, tilt) = len(x), _bend(x, y, weights, slope)
    residuals = [v - offset - (slope + tilt) * u for u, v in zip(x, y, strict=True)]
    weighted: list[float] = list(map(mul, weights, x))
    scores: list[float] = list(map(mul, weighted, residuals))
    square: float = exact_sum(map(mul, weighted, x))
    sums = list(accumulate([0.0] * (LAGS + 1) + scores + [0.0] * LAGS))
    together = exact_sum([(b - a) * (b - a) for a, b in zip(sums, sums[LAGS + 1 :], strict=False)]) / (LAGS + 1)
    apart = square * exact_sum([w * r * r for w, r in zip(weights, residuals, strict=True)])
    variance = max(n * together, apart) / (n - 2) / square
    return OriginFit(slope, student_factor(n - 2) * sqrt(variance / square), square, variance, n - 2)


def student_factor(freedom: int) -> float:
    """Return the factor by which a standard error from few values must grow for two of it to cover 95 %.

    It is infinite without any degree of freedom.
    """
    if freedom < 1:
        return inf
    return STUDENT[freedom] if freedom < len(STUDENT) else 1.0 + 1.3 / freedom


def _bend(x: Sequence[float], y: Sequence[float], weights: Sequence[float], slope: float) -> tuple[float, float]:
    """Return the line (a, c) of a + c x through the residuals: the mud's deviation from the law, not scatter."""
    sw = sx = sy = sxx = sxy = 0.0
    for u, v, w in zip(x, y, weights, strict=True):
        r = v - slope * u
        sw += w
        sx += w * u
        sy += w * r
        sxx += w * u * u
        sxy += w * u * r
    spread = sw * sxx - sx * sx
    if not spread > 1e-9 * sw * sxx:
        return 0.0, 0.0
    tilt = (sw * sxy - sx * sy) / spread
    return (sy - tilt * sx) / sw, tilt
