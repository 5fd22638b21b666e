"""The samples of one fit, for reports: how well k times the moment explains the torque of a stroke.

R² is 1 - Σ w r² / Σ w τ², as R and statsmodels compute it for a line through the origin, with the travel of each batch
as its weight w. It is large as soon as there is a torque. R² about the mean has Σ w (τ - τ̄)² in the denominator: it is
negative where a torque that is constant over depth would explain the samples better than the law does. Outliers count
in full in both, although they count less in the fit.
"""

from collections.abc import Callable, Sequence
from math import sqrt
from typing import NamedTuple

from control.computing.exact_sum import exact_sum
from control.records import UNKNOWN


class FitSamples(NamedTuple):
    """A batch of travel for each entry. A bound is no fit and has no samples."""

    moments_m4: Sequence[float]
    torques_nm: Sequence[float]  # of the mud, against the motion
    weights_m: Sequence[float]  # travel
    sweeps_rad: Sequence[float]
    depths_m: Sequence[float]  # of the middle of the lower edge, below the surface
    slope: float  # the fitted coefficient, N/m³

    @property
    def residuals_nm(self) -> list[float]:
        return [torque - self.slope * moment for moment, torque in zip(self.moments_m4, self.torques_nm, strict=True)]

    @property
    def rms_residual_nm(self) -> float:
        return sqrt(self._mean([residual**2 for residual in self.residuals_nm]))

    @property
    def r_squared(self) -> float:
        return self._explained(0.0)

    @property
    def r_squared_about_mean(self) -> float:
        return self._explained(self._mean(self.torques_nm))

    def _explained(self, reference_nm: float) -> float:
        """Return NaN where all torques are the reference."""
        variance = self._mean([(torque - reference_nm) ** 2 for torque in self.torques_nm])
        return 1.0 - self.rms_residual_nm**2 / variance if variance > 0.0 else UNKNOWN

    def _mean(self, values: Sequence[float]) -> float:
        return exact_sum(w * value for w, value in zip(self.weights_m, values, strict=True)) / exact_sum(self.weights_m)


def no_samples() -> FitSamples | None:
    return None


class StrideFits(NamedTuple):
    """The fits of one stride of one flipper, each computed when it is asked for: the loop never asks."""

    k_p: Callable[[], FitSamples | None] = no_samples
    k_s: Callable[[], FitSamples | None] = no_samples
    k_e: Callable[[], FitSamples | None] = no_samples


NO_FITS = StrideFits()
