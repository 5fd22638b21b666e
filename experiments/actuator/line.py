"""The line of a motor's current over the torque of what hangs, and how true slope and intercept are by their scatter.

Ordinary least squares. A hook that is not quite in its place errs with the weight and a reading does not, so heavy
weights scatter more, and they alone decide on the slope: its standard error is MacKinnon and White's (1985, HC3),
which takes each residual for its own weight's scatter. Both errors carry Student's factor, so that two of them cover
95 % however few the readings are.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from statistics import fmean
from typing import NamedTuple

from estimation.strokes.origin_fit import student_factor

FEWEST = 3  # readings of a line


class Line(NamedTuple):
    """I = slope τ + intercept."""

    slope_a_nm: float
    intercept_a: float
    slope_error: float
    intercept_error: float
    readings: int

    @property
    def constant_nm_a(self) -> float:
        return 1.0 / self.slope_a_nm

    @property
    def constant_error_nm_a(self) -> float:
        """By the scatter alone."""
        return self.slope_error / self.slope_a_nm**2


def fit_line(x: Sequence[float], y: Sequence[float]) -> Line:
    """Needs FEWEST points, not all of one x."""
    count, x_mean = len(x), fmean(x)
    spread = sum((each - x_mean) ** 2 for each in x)
    slope = sum((a - x_mean) * b for a, b in zip(x, y, strict=True)) / spread
    intercept = fmean(y) - slope * x_mean
    slope_square = intercept_square = 0.0
    for a, b in zip(x, y, strict=True):
        fraction = (a - x_mean) / spread  # of the slope that this point makes
        leverage = 1.0 / count + fraction * (a - x_mean)
        alone = (b - intercept - slope * a) / (1.0 - leverage)  # what the line of the others misses it by
        slope_square += (fraction * alone) ** 2
        intercept_square += ((1.0 / count - x_mean * fraction) * alone) ** 2
    student = student_factor(count - 2)
    return Line(slope, intercept, student * sqrt(slope_square), student * sqrt(intercept_square), count)
