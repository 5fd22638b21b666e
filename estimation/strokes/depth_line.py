"""A line through the readings of one coefficient in one mud: ln k against ln z.

The line has a level x̄ (information W = Σ 1/r², at the strides' weighted mean h̄ of ln z) and a slope m, the exponent of
the depth law. About that mean the 2×2 normal equations are diagonal, so a stride with x = ln k at h = ln z takes a few
scalar updates,

    m += g (x - x̄ - m (h - h̄)) / I     I += g (h - h̄)     with g = W w (h - h̄) / (W + w) and w = 1/r²
    x̄ += w (x - x̄) / (W + w)           h̄ likewise          W += w

which is weighted least squares with a prior on m. r² = (repeatability/k)² + 0.08²: strides in the same mud differ by
8 % beyond their errors, as in the authors' logs. W fades once it holds eight strides, so the line follows slow change.
The errors common to all strides (a torque constant, the plate's dimensions) are averaged apart, for the level alone.
"""

from __future__ import annotations

from math import exp, log, sqrt
from typing import NamedTuple

from control.mud_estimate import Coefficient
from control.records import Estimate
from estimation.strokes.withstood import SHALLOWEST_M

REPEATABILITY = 0.08  # of k, from stride to stride in the same mud
REMEMBERED_STRIDES = 8
SURE_EXPONENT = 0.1  # its smallest standard error: mud's law is no exact power
DEPTHS_M = (SHALLOWEST_M, 0.5)
COEFFICIENTS_N_M3 = (1e2, 1e10)  # 0.0001 to 10000 N/cm³: what lies outside is not mud


class DepthLaw(NamedTuple):
    """The prior of the exponent."""

    exponent: float
    std_error: float


# A force exponent from 1 (the same pressure everywhere) to 2 (the paper's triangle), where k_s assumes 2.
# The theory of undrained clay spans it between 20 and 50 mm (docs/explanation/estimation.md).
SHEAR_LAW = DepthLaw(-0.5, 0.3)
# 0.5 to 1 in the authors' logs (end bearing and adhesion), where k_p and k_e assume 1.
STROKE_LAW = DepthLaw(-0.4, 0.3)


class Reading(NamedTuple):
    """One coefficient of one stride, in logarithms."""

    log_k: float
    variance: float
    log_depth: float
    at_least: bool = False
    common: float = 0.0  # variance of the errors that all strides share


def reading_of(estimate: Estimate, depth_m: float) -> Reading | None:
    """Return the logarithms of an estimate; None if it is invalid or outside the range of muds."""
    k, error = estimate.value, estimate.repeatability
    if not ((estimate.valid or estimate.at_least) and DEPTHS_M[0] <= depth_m <= DEPTHS_M[1]):
        return None
    least, most = COEFFICIENTS_N_M3
    if not (least <= k <= most and 0.0 <= error <= k and 0.0 <= estimate.std_error <= most):
        return None
    relative = error / k
    return Reading(
        log_k=log(k),
        variance=relative * relative + REPEATABILITY * REPEATABILITY,
        log_depth=log(depth_m),
        at_least=estimate.at_least,
        common=common_variance(estimate),
    )


def common_variance(estimate: Estimate | Coefficient) -> float:
    """Return the relative variance of the errors that all strides share."""
    whole, own = estimate.std_error / estimate.value, estimate.repeatability / estimate.value
    return max(0.0, whole * whole - own * own)


class Line(NamedTuple):
    """The weighted line of ln k against ln z through some strides in one mud."""

    weight: float
    log_k: float
    log_depth: float
    exponent: float
    exponent_weight: float
    strides: int
    common: float = 0.0

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
            self.common + fraction * (reading.common - self.common),
        )

    def expected(self, log_depth: float) -> tuple[float, float]:
        """Return ln k at another depth and its variance."""
        deeper = log_depth - self.log_depth
        return self.log_k + self.exponent * deeper, 1.0 / self.weight + deeper * deeper / self.exponent_weight

    def agrees(self, reading: Reading | None, deviations: float) -> bool:
        """Return whether a reading fits the line. A lower bound disagrees only from above; no reading always agrees."""
        if reading is None or self.strides == 0:
            return True
        log_k, variance = self.expected(reading.log_depth)
        largest = deviations * sqrt(variance + reading.variance)
        return -largest <= reading.log_k - log_k <= largest or (reading.at_least and reading.log_k < log_k)

    def coefficient(self) -> Coefficient:
        k, depth_m = exp(self.log_k), exp(self.log_depth)
        return Coefficient(
            value=k,
            std_error=k * sqrt(1.0 / self.weight + self.common),
            repeatability=k / sqrt(self.weight),
            depth_m=depth_m,
            exponent=self.exponent,
            exponent_std_error=1.0 / sqrt(self.exponent_weight),
            strides=self.strides,
        )
