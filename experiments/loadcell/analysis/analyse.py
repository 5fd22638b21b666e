"""From recorded trials to coefficients, with measured positions or from the force alone.

All trials have the same stage and devices: speed and ramps, or an encoder's lag, are found in each trial and then
fitted again near the median of all.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, sqrt
from statistics import median, stdev

import numpy as np

from estimation.strokes.origin_fit import NORMAL_MAD
from experiments.loadcell.analysis.coefficients import (
    SHEAR,
    SHIFT,
    AnalysedTrial,
    Recorded,
    analyse_insertion,
    analyse_shear,
)
from experiments.loadcell.analysis.contact import Profile, StrokeError, find_contact, without_spikes
from experiments.loadcell.analysis.force_motion import Insertion, Pace, StageSettings, wide_pace
from experiments.loadcell.analysis.measured_coefficients import analyse_measured
from experiments.loadcell.analysis.stage_track import MEDIAN_ERROR, WIDE, Alignment, common_alignment
from experiments.trials.session import Show

LEAST_SPEED_UNCERTAINTY, LEAST_RAMP_UNCERTAINTY = 0.005, 0.1  # of a stage, from trial to trial
SET_SPEED_UNCERTAINTY = 0.01  # of a stage's controller
AGREEING = 3.0  # standard errors


def analyse(trials: Sequence[Recorded], settings: StageSettings, show: Show) -> list[AnalysedTrial]:
    """Analyse all trials of one stage, the second time near their common values."""
    first = []
    for done, trial in enumerate(trials):
        show(done, len(trials))
        first.append(analyse_trial(trial, settings, wide_pace(settings)))
    return _refine_by_force(_refine_measured(first, settings), settings)


def _refine_measured(first: Sequence[AnalysedTrial], settings: StageSettings) -> list[AnalysedTrial]:
    common = common_alignment([trial.alignment for trial in first if trial.alignment is not None])
    return [_realigned(trial, common, settings) if trial.is_measured else trial for trial in first]


def _realigned(trial: AnalysedTrial, common: Alignment, settings: StageSettings) -> AnalysedTrial:
    """Analyse again, and add the relative error from the lag that all trials share."""
    again = analyse_trial(trial.recorded, settings, wide_pace(settings), common)
    if again.alignment is None or not isinstance(again.motion, Insertion):
        return again
    lag_s = min(common.lag_uncertainty_s, again.alignment.lag_uncertainty_s)
    shared = SHIFT * again.motion.pace.speed_m_s * lag_s / settings.depth_m
    return replace(again, shared_uncertainty=hypot(again.shared_uncertainty, shared))


def _refine_by_force(first: list[AnalysedTrial], settings: StageSettings) -> list[AnalysedTrial]:
    paces = [trial.pace for trial in first if trial.pace is not None]
    if len(paces) < 3:
        return first
    common, uncertainty = common_pace(paces, settings)
    again = [analyse_trial(trial.recorded, settings, common) if trial.pace else trial for trial in first]
    return [replace(trial, shared_uncertainty=uncertainty) if trial.pace else trial for trial in again]


def common_pace(paces: Sequence[Pace], settings: StageSettings) -> tuple[Pace, float]:
    """Return the median of the trials' speeds and ramps with their scatter, and the uncertainty of the speed.

    The set speed counts as a measurement of its own, unless the trials contradict it; the uncertainty grows where
    the two do not agree.
    """
    speeds, uncertainties = [pace.speed_m_s for pace in paces], [pace.speed_uncertainty for pace in paces]
    speed, scatter = _common(speeds, uncertainties)
    error = MEDIAN_ERROR * max(stdev(speeds) / speed, median(uncertainties), LEAST_SPEED_UNCERTAINTY) / sqrt(len(paces))
    apart = abs(speed / settings.speed_m_s - 1.0) / hypot(error, SET_SPEED_UNCERTAINTY)
    if apart < AGREEING:
        prior, own = 1.0 / SET_SPEED_UNCERTAINTY**2, 1.0 / error**2
        speed = (prior * settings.speed_m_s + own * speed) / (prior + own)
        error = max(1.0, apart) / sqrt(prior + own)
    ramp, ramp_scatter = _common(
        [pace.acceleration_m_s2 for pace in paces], [pace.acceleration_uncertainty for pace in paces]
    )
    return Pace(
        speed, ramp, max(LEAST_SPEED_UNCERTAINTY, scatter, error), max(LEAST_RAMP_UNCERTAINTY, ramp_scatter)
    ), error


def _common(values: Sequence[float], uncertainties: Sequence[float]) -> tuple[float, float]:
    """Return the median, and the relative scatter between trials: robust to outliers, less their own uncertainty."""
    middle = median(values)
    scatter = NORMAL_MAD * median(abs(value / middle - 1.0) for value in values)
    return middle, sqrt(max(0.0, scatter**2 - median(uncertainties) ** 2))


def analyse_trial(trial: Recorded, settings: StageSettings, expected: Pace, aligned: Alignment = WIDE) -> AnalysedTrial:
    try:
        profile = find_contact(trial.times_s, without_spikes(trial.forces_n))
    except StrokeError as problem:
        return AnalysedTrial(trial, problem=str(problem))
    if trial.positions is None:
        return _by_force(trial, profile, settings, expected)
    try:
        return analyse_measured(trial, profile, settings, aligned)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        by_force = _by_force(trial, profile, settings, expected)
        return replace(by_force, remark=f"the position is not used: {problem}")


def _by_force(trial: Recorded, profile: Profile, settings: StageSettings, expected: Pace) -> AnalysedTrial:
    try:
        if trial.kind == SHEAR:
            return analyse_shear(trial, profile, settings)
        return analyse_insertion(trial, profile, settings, expected)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        return AnalysedTrial(trial, problem=str(problem))
