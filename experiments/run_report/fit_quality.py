"""R² and residuals of the fits that the estimates come from, stride by stride and by mud."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from statistics import median
from typing import Any

from estimation.strokes.fit_samples import FitSamples, StrideFits
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.text_tables import number
from experiments.run_report.run import ReportedStride, Run
from firmware_host.operator.reports import known

N_CM = 100.0  # in a newton metre
R_SQUARED = (
    "R² is 1 - Σr²/Στ² of torques τ and residuals r, as usual for a line through the origin. R² about the mean has "
    "Σ(τ - τ̄)² in its place: below 0 a constant torque would explain the stroke better than the law. Residuals are "
    "root mean squares. A lower bound has no fit. The table has the median over strides."
)


@dataclass(frozen=True)
class Quality:
    """The fits of one coefficient by one flipper in one mud: medians over strides."""

    fits: int
    r_squared: float | None
    r_squared_about_mean: float | None
    rms_residual_nm: float | None


def quality_of(strides: Iterable[ReportedStride], flipper: str, name: str) -> Quality:
    found = [samples for stride in strides if (samples := stride.samples(flipper, name))]
    return Quality(
        fits=len(found),
        r_squared=_median([samples.r_squared for samples in found]),
        r_squared_about_mean=_median([samples.r_squared_about_mean for samples in found]),
        rms_residual_nm=_median([samples.rms_residual_nm for samples in found]),
    )


def _median(values: Sequence[float]) -> float | None:
    finite = [value for value in values if isfinite(value)]
    return median(finite) if finite else None


def fits_report(fits: StrideFits) -> dict[str, Any]:
    """Return the quality of one stride's fits for JSON; null for a coefficient without a fit."""
    return {name: _samples_report(getattr(fits, name)()) for name in COEFFICIENTS}


def _samples_report(samples: FitSamples | None) -> dict[str, Any] | None:
    if samples is None:
        return None
    return {
        "r_squared": known(samples.r_squared),
        "r_squared_about_mean": known(samples.r_squared_about_mean),
        "rms_residual_nm": known(samples.rms_residual_nm),
        "samples": len(samples.torques_nm),
    }


def quality_rows(run: Run) -> list[list[str]]:
    """List the quality of all fits by mud and coefficient, the flippers side by side."""
    head = ["mud", ""]
    for flipper in run.flippers:
        head += [f"{flipper}: fits", "R²", "R² about mean", "residual (N·cm)"]
    rows = [head]
    for mud in dict.fromkeys(stride.mud for stride in run.strides if stride.mud):
        strides = [stride for stride in run.strides if stride.mud == mud]
        for name in COEFFICIENTS:
            cells = [cell for flipper in run.flippers for cell in _cells(quality_of(strides, flipper, name))]
            rows.append([mud if name == COEFFICIENTS[0] else "", name, *cells])
    return rows


def _cells(quality: Quality) -> list[str]:
    residual_nm = quality.rms_residual_nm
    return [
        str(quality.fits or "-"),
        number(quality.r_squared),
        number(quality.r_squared_about_mean, 2),
        number(None if residual_nm is None else N_CM * residual_nm, 2),
    ]
