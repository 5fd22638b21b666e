"""A line through what strides in one mud said of one coefficient: ln k against ln z.

Its level x̄ (information W = Σ 1/r², at the strides' weighted mean h̄ of ln z) and its slope m, the exponent of the depth
law. Seen from that mean the 2×2 normal equations are diagonal, so a stride that told x = ln k at h = ln z is a few
scalar updates,

    m += g (x - x̄ - m (h - h̄)) / I     I += g (h - h̄)     with g = W w (h - h̄) / (W + w) and w = 1/r²
    x̄ += w (x - x̄) / (W + w)           h̄ likewise          W += w

which is weighted least squares with a prior on m. r² = (std_error/k)² + 0.08²: strides in the same mud differ by 8 %
beyond their own doubt, as in the authors' logs. W fades once it holds eight strides, so slow change is followed. What
errs alike in every stride (a torque constant, the plate's measures) is in no doubt given here.
"""

from __future__ import annotations

from math import exp, log, sqrt
from typing import NamedTuple

from control.mud_estimate import Coefficient
from control.records import Estimate

REPEATABILITY = 0.08  # of k, from stride to stride in the same mud
REMEMBERED_STRIDES = 8
SURE_EXPONENT = 0.1  # its doubt never gets smaller: mud's law is no exact power
DEPTHS_M = (0.005, 0.5)  # a stride shallower than that tells of the surface, not of the mud
COEFFICIENTS_N_M3 = (1e2, 1e10)  # 0.0001 to 10000 N/cm³: what lies outside is not mud


class DepthLaw(NamedTuple):
    """The exponent as far as it is known before any stride."""

    exponent: float
    std_error: float


class Reading(NamedTuple):
    """One coefficient of one stride, in logarithms."""

    log_k: float
    variance: float
    log_depth: float
    at_least: bool = False


def reading_of(estimate: Estimate, depth_m: float) -> Reading | None:
    """None where it says nothing, or nothing that can be true."""
    k, std_error = estimate.value, estimate.std_error
    if not ((estimate.valid or estimate.at_least) and DEPTHS_M[0] <= depth_m <= DEPTHS_M[1]):
        return None
    if not (COEFFICIENTS_N_M3[0] <= k <= COEFFICIENTS_N_M3[1] and 0.0 <= std_error <= k):
        return None
    relative = std_error / k
    return Reading(log(k), relative * relative + REPEATABILITY * REPEATABILITY, log(depth_m), estimate.at_least)


class Line(NamedTuple):
    """ln k against ln z: what some strides in one mud say."""

    weight: float
    log_k: float
    log_depth: float
    exponent: float
    exponent_weight: float
    strides: int

    def plus(self, reading: Reading | None) -> Line:
        if reading is None or reading.at_least:
            return self
        weight = 1.0 / reading.variance
        fraction = weight / (self.weight + weight)
        deeper, stronger = reading.log_depth - self.log_depth, reading.log_k - self.log_k
        leverage = self.weight * fraction * deeper
        exponent_weight = self.exponent_weight + leverage * deeper
        fading = REMEMBERED_STRIDES / (REMEMBERED_STRIDES + 1.0) if self.strides >= REMEMBERED_STRIDES else 1.0
        return Line(
            fading * (self.weight + weight),
            self.log_k + fraction * stronger,
            self.log_depth + fraction * deeper,
            self.exponent + leverage * (stronger - self.exponent * deeper) / exponent_weight,
            min(exponent_weight, 1.0 / SURE_EXPONENT**2),
            self.strides + 1,
        )

    def expected(self, log_depth: float) -> tuple[float, float]:
        """ln k at another depth and its variance."""
        deeper = log_depth - self.log_depth
        return self.log_k + self.exponent * deeper, 1.0 / self.weight + deeper * deeper / self.exponent_weight

    def agrees(self, reading: Reading | None, deviations: float) -> bool:
        """A lower bound disagrees only from above; what says nothing agrees with everything."""
        if reading is None or self.strides == 0:
            return True
        log_k, variance = self.expected(reading.log_depth)
        largest = deviations * sqrt(variance + reading.variance)
        return -largest <= reading.log_k - log_k <= largest or (reading.at_least and reading.log_k < log_k)

    def coefficient(self) -> Coefficient:
        k, depth_m = exp(self.log_k), exp(self.log_depth)
        std_error, exponent_std_error = k / sqrt(self.weight), 1.0 / sqrt(self.exponent_weight)
        return Coefficient(k, std_error, depth_m, self.exponent, exponent_std_error, self.strides)
