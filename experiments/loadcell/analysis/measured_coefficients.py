"""Coefficients of trials with a measured position, by the definitions of coefficients.py.

Depths are the encoder's, from the surface that the force shows; only a shear keeps the set depth. Forces are corrected
to the set speed.
"""

from math import hypot

import numpy as np
from numpy.typing import NDArray

from control.plate_integrals import submerged_part
from experiments.loadcell.analysis.coefficients import (
    RESIDUAL_FRACTION,
    RESIDUAL_NOISES,
    SHEAR,
    SHIFT,
    UNKNOWN_COEFFICIENT,
    AnalysedTrial,
    Coefficient,
    Recorded,
    slope,
    steadiness,
    volume_m3,
)
from experiments.loadcell.analysis.contact import Profile, StrokeError
from experiments.loadcell.analysis.curve_fit import Array
from experiments.loadcell.analysis.force_motion import REVERSAL_FRACTION, StageSettings
from experiments.loadcell.analysis.measured_motion import (
    LEAST_SAMPLES,
    Mask,
    MeasuredInsertion,
    find_insertion,
    find_shear,
)
from experiments.loadcell.analysis.stage_track import (
    LEAST_POSITIONS,
    Alignment,
    PositionedProfile,
    StageTrack,
    fit_rate,
)

DEPTH_BOUND = 0.1  # difference from the set depth that is remarked
EVEN_DEPTHS = 60
LAST_FRACTION = 0.3


def analyse_measured(trial: Recorded, profile: Profile, settings: StageSettings, expected: Alignment) -> AnalysedTrial:
    """Raises StrokeError where the positions do not show the stroke."""
    if trial.positions is None or len(trial.positions.times_s) < LEAST_POSITIONS:
        raise StrokeError("the encoder measured hardly any position")
    stroke = PositionedProfile(profile, StageTrack(trial.positions), settings)
    return (_shear if trial.kind == SHEAR else _insertion)(trial, stroke, expected)


def _insertion(trial: Recorded, stroke: PositionedProfile, expected: Alignment) -> AnalysedTrial:
    measured, profile, settings = find_insertion(stroke, expected), stroke.profile, stroke.settings
    motion, lag = measured.motion, measured.alignment
    rates = expected.rate_uncertainty * stroke.speed_terms(lag.lag_s)
    unsure_m = hypot(measured.surface_std_error_m, stroke.track.interpolation_error_m)
    opposing_n = profile.forces_n - motion.level_n
    coefficients = {"k_p": _slope(measured, settings, opposing_n, measured.down, measured.deepest_m, unsure_m, rates)}
    has_extraction, remark = np.count_nonzero(measured.up) >= LEAST_SAMPLES, _insertion_remark(stroke, measured)
    if has_extraction:
        unsure_m = hypot(unsure_m, motion.pace.speed_m_s * lag.lag_uncertainty_s)
        to_m = (1.0 - REVERSAL_FRACTION) * measured.deepest_m
        opposing_n = measured.extraction.level_n - profile.forces_n
        coefficients["k_e"] = _slope(measured, settings, opposing_n, measured.up, to_m, unsure_m, rates)
    else:
        coefficients["k_e"] = UNKNOWN_COEFFICIENT
        remark = "no extraction: the encoder did not see the plate come up. Was it lifted out in time?"
    return AnalysedTrial(
        trial,
        profile,
        motion,
        measured.extraction if has_extraction else None,
        coefficients,
        remark=remark,
        shared_uncertainty=_rate_uncertainty(measured, measured.down | measured.up, rates),
        positions_m=measured.depths_m,
        position_error_m=unsure_m,
        alignment=lag,
    )


def _by_depth(motion: MeasuredInsertion, chosen: Mask) -> NDArray[np.intp]:
    return np.flatnonzero(chosen)[np.argsort(motion.depths_m[chosen], kind="stable")]


def _rate_uncertainty(motion: MeasuredInsertion, chosen: Mask, rates: Array) -> float:
    """Return the relative uncertainty of k from those of the force at each sample's speed."""
    order = _by_depth(motion, chosen)
    depths_m = motion.depths_m[order]
    return abs(float(np.average(rates[order], weights=depths_m * np.clip(np.gradient(depths_m), 1e-9, None))))


def _slope(
    motion: MeasuredInsertion,
    settings: StageSettings,
    forces_n: Array,
    chosen: Mask,
    to_m: float,
    unsure_m: float,
    rates: Array,
) -> Coefficient:
    """Fit k from the surface to `to_m`, with equal weight for equal travel wherever the stage rested."""
    order = _by_depth(motion, chosen)
    depths_m, corrected_n = motion.depths_m[order], forces_n[order] / motion.speed_factors[order]
    unsure = hypot(SHIFT * unsure_m / to_m, _rate_uncertainty(motion, chosen, rates))
    uncertainty = slope(settings, depths_m, corrected_n, to_m, unsure).std_error
    even_m = to_m * (np.arange(EVEN_DEPTHS) + 0.5) / EVEN_DEPTHS
    even_n = np.interp(even_m, np.append(0.0, depths_m), np.append(0.0, corrected_n))
    last = depths_m > depths_m[-1] - LAST_FRACTION * to_m
    if np.count_nonzero(last) > 2:  # down to where the stage stopped, by the line of the last piece
        line = np.polyfit(depths_m[last], corrected_n[last], 1)
        even_n = np.where(even_m > depths_m[-1], np.polyval(line, even_m), even_n)
    volumes_m3 = volume_m3(settings, even_m)
    return Coefficient(float(volumes_m3 @ even_n / (volumes_m3 @ volumes_m3)), uncertainty)


def _insertion_remark(stroke: PositionedProfile, measured: MeasuredInsertion) -> str:
    profile, motion, set_m = stroke.profile, measured.motion, stroke.settings.depth_m
    largest_n = float(np.max(np.abs(profile.forces_n[measured.down] - motion.level_n)))
    if abs(measured.deepest_m / set_m - 1.0) > DEPTH_BOUND:
        return (
            f"the plate went {100.0 * measured.deepest_m:.1f} cm deep by the encoder, and {100.0 * set_m:g} cm was "
            "set: coefficients of a mud depend on the depth; or --position-step is not its travel per count"
        )
    if motion.residual_n > max(RESIDUAL_NOISES * profile.noise_n, RESIDUAL_FRACTION * largest_n):
        return (
            f"the force is {motion.residual_n:.3f} N off one that grows with the measured depth: the mud has lumps, or "
            "the encoder slips"
        )
    return ""


def _shear(trial: Recorded, stroke: PositionedProfile, expected: Alignment) -> AnalysedTrial:
    measured, profile, settings = find_shear(stroke, expected.lag_s), stroke.profile, stroke.settings
    zero_n, steady = -trial.zero_n if profile.turned else trial.zero_n, measured.steady
    felt_n, speed_terms = (profile.forces_n - zero_n)[steady], stroke.speed_terms(expected.lag_s)[steady]
    travels_m = np.clip(np.gradient(measured.travels_m[steady]), 1e-9, None)
    forces_n = felt_n / (1.0 + expected.rate_fraction * speed_terms)
    mean_n = float(np.average(forces_n, weights=travels_m))
    if mean_n <= 0.0:
        raise StrokeError("the force does not oppose the motion")
    rate_n = mean_n * expected.rate_uncertainty * float(np.average(speed_terms, weights=travels_m))
    error_n, remark = steadiness(forces_n)
    moment_m3 = submerged_part(settings.plate, settings.depth_m, 0.0, 1.0).depth_moment_m3
    return AnalysedTrial(
        trial,
        profile,
        measured.motion,
        None,
        {"k_s": Coefficient(mean_n / moment_m3, hypot(error_n, rate_n) / moment_m3)},
        remark=remark,
        shared_uncertainty=abs(rate_n) / mean_n,
        positions_m=measured.travels_m,
        position_error_m=stroke.track.interpolation_error_m,
        alignment=fit_rate(felt_n, speed_terms),
    )
