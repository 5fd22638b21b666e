"""The estimate of the mud between strides: each coefficient with its standard error and its depth law.

The coefficients of plate_integrals.py stand for forces that grow with the depth squared (k_s) or with the submerged
volume (k_p, k_e). Mud's forces grow more slowly, so the same mud reads softer in a deeper stride: by the clay practice
of Matlock (1970) k_s at 5 cm is a third lower than at 3 cm. Near the depth z₀ of the strides it came from, k ∝ z^m.
The exponent is learned too, and its error grows with the distance of the prediction from z₀:

    ln k(z) = ln k + m ln(z/z₀)        (error/k)² at z  =  (repeatability/k)² + ln²(z/z₀) · (exponent_std_error)²

z₀ is the weighted mean of the strides' ln z: there the errors of ln k and m are independent, as the sum assumes. The
robot compares and predicts by the repeatability, since what all its strides have in common (the torque constant, the
levers) acts alike on the force that it measured and on the force that it will need.
"""

from math import exp, hypot, log
from typing import NamedTuple

from control.records import UNKNOWN

LARGEST_LOG_RATIO = 300.0  # keeps exp() and a few products of it finite


class Coefficient(NamedTuple):
    value: float  # N/m³, at depth_m
    std_error: float  # N/m³, with what all strides have in common
    repeatability: float  # N/m³, without it
    depth_m: float  # below the mud's surface
    exponent: float  # k ∝ z^exponent near depth_m
    exponent_std_error: float
    strides: int  # that the estimate is made from
    at_least: bool = False  # the mud never yielded: a lower bound

    def at(self, depth_m: float) -> tuple[float, float]:
        """Return value and repeatability at another depth; NaN above the mud."""
        if not (depth_m > 0.0 and self.depth_m > 0.0):
            return UNKNOWN, UNKNOWN
        log_depths = log(depth_m) - log(self.depth_m)
        log_ratio = self.exponent * log_depths
        ratio = exp(min(max(log_ratio, -LARGEST_LOG_RATIO), LARGEST_LOG_RATIO))
        value = ratio * self.value
        return value, hypot(ratio * self.repeatability, value * log_depths * self.exponent_std_error)


class FlipperEstimate(NamedTuple):
    """The coefficients from one flipper's strides; None if unknown."""

    k_p: Coefficient | None = None
    k_s: Coefficient | None = None
    k_e: Coefficient | None = None


class MudEstimate(NamedTuple):
    """The coefficients of each flipper, and of both together where they agree.

    A common coefficient is None while the flippers are in two different muds.
    """

    k_p: Coefficient | None = None
    k_s: Coefficient | None = None
    k_e: Coefficient | None = None
    left: FlipperEstimate = FlipperEstimate()
    right: FlipperEstimate = FlipperEstimate()
    boundary: bool = False  # this stride did not fit the memory, which was dropped: the mud changed

    def of(self, flipper: str) -> FlipperEstimate:
        return self.left if flipper == "left" else self.right


NOTHING_KNOWN = MudEstimate()
