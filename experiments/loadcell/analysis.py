"""From recorded trials to coefficients: by the place that an encoder measured, or by the force alone.

A stage moves alike in all trials, and its devices are the same: what each trial tells of speed and ramps, or of an
encoder's lag, is fitted again near the median of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, sqrt
from statistics import median, stdev

import numpy as np

from estimation.strokes.origin_fit import NORMAL_MAD
from experiments.loadcell.alignment import MEDIAN_ERROR, WIDE, Alignment, common_alignment
from experiments.loadcell.contact import Profile, StrokeError, find_contact, without_spikes
from experiments.loadcell.fits import SHEAR, SHIFT, Analysed, Recorded, analyse_insertion, analyse_shear
from experiments.loadcell.measured import analyse_measured
from experiments.loadcell.motion import Insertion, Pace, StageSettings, wide_pace
from experiments.trials.session import Show

LEAST_SPEED_UNCERTAINTY, LEAST_RAMP_UNCERTAINTY = 0.005, 0.1  # of a stage, from trial to trial
SET_SPEED_UNCERTAINTY = 0.01  # of a stage's controller
AGREEING = 3.0  # standard errors


def analyse(trials: Sequence[Recorded], settings: StageSettings, show: Show) -> list[Analysed]:
    """All trials of one stage; the second time near what they have in common."""
    first = []
    for done, trial in enumerate(trials):
        show(done, len(trials))
        first.append(analyse_trial(trial, settings, wide_pace(settings)))
    return _again_by_force(_again_by_place(first, settings), settings)


def _again_by_place(first: Sequence[Analysed], settings: StageSettings) -> list[Analysed]:
    aligned = [reported.alignment for reported in first if reported.alignment is not None]
    common = common_alignment(aligned)
    pace = wide_pace(settings)
    again = [
        analyse_trial(reported.recorded, settings, pace, common) if reported.is_measured else reported
        for reported in first
    ]
    return [
        replace(reported, shared_uncertainty=hypot(reported.shared_uncertainty, _of_lag(reported, common, settings)))
        if reported.is_measured
        else reported
        for reported in again
    ]


def _of_lag(reported: Analysed, common: Alignment, settings: StageSettings) -> float:
    """What a lag that all trials have wrong alike makes of a depth, as a share of the coefficient."""
    speed_m_s = reported.speed_m_s if isinstance(reported.motion, Insertion) else None
    own_s = reported.alignment.lag_uncertainty_s if reported.alignment is not None else 0.0
    return SHIFT * (speed_m_s or 0.0) * min(common.lag_uncertainty_s, own_s) / settings.depth_m


def _again_by_force(first: list[Analysed], settings: StageSettings) -> list[Analysed]:
    paces = [reported.pace for reported in first if reported.pace is not None]
    if len(paces) < 3:
        return first
    common, uncertainty = common_pace(paces, settings)
    again = [analyse_trial(reported.recorded, settings, common) if reported.pace else reported for reported in first]
    return [replace(reported, shared_uncertainty=uncertainty) if reported.pace else reported for reported in again]


def common_pace(paces: Sequence[Pace], settings: StageSettings) -> tuple[Pace, float]:
    """The median of a stage's trials, and what they scatter beyond their own doubts. The speed that was set counts as
    a measurement of its own, unless the trials say that it was another. And the doubt of that speed, which grows where
    the two do not agree.
    """
    speeds, uncertainties = [pace.speed_m_s for pace in paces], [pace.speed_uncertainty for pace in paces]
    speed, scatter = _common(speeds, uncertainties)
    error = MEDIAN_ERROR * max(stdev(speeds) / speed, median(uncertainties), LEAST_SPEED_UNCERTAINTY) / sqrt(len(paces))
    apart = abs(speed / settings.speed_m_s - 1.0) / hypot(error, SET_SPEED_UNCERTAINTY)
    if apart < AGREEING:
        reported, own = 1.0 / SET_SPEED_UNCERTAINTY**2, 1.0 / error**2
        speed = (reported * settings.speed_m_s + own * speed) / (reported + own)
        error = max(1.0, apart) / sqrt(reported + own)
    ramp, ramp_scatter = _common(
        [pace.acceleration_m_s2 for pace in paces], [pace.acceleration_uncertainty for pace in paces]
    )
    return Pace(
        speed, ramp, max(LEAST_SPEED_UNCERTAINTY, scatter, error), max(LEAST_RAMP_UNCERTAINTY, ramp_scatter)
    ), error


def _common(values: Sequence[float], uncertainties: Sequence[float]) -> tuple[float, float]:
    return median(values), sqrt(max(0.0, _scatter(values) ** 2 - median(uncertainties) ** 2))


def _scatter(values: Sequence[float]) -> float:
    """As a share, whatever single ones do."""
    middle = median(values)
    return NORMAL_MAD * median(abs(value / middle - 1.0) for value in values)


def analyse_trial(trial: Recorded, settings: StageSettings, expected: Pace, aligned: Alignment = WIDE) -> Analysed:
    try:
        profile = find_contact(trial.times_s, without_spikes(trial.forces_n))
    except StrokeError as problem:
        return Analysed(trial, problem=str(problem))
    if trial.places is None:
        return _by_force(trial, profile, settings, expected)
    try:
        return analyse_measured(trial, profile, settings, aligned)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        reported = _by_force(trial, profile, settings, expected)
        return replace(reported, remark=f"the place is not used: {problem}")


def _by_force(trial: Recorded, profile: Profile, settings: StageSettings, expected: Pace) -> Analysed:
    try:
        if trial.kind == SHEAR:
            return analyse_shear(trial, profile, settings)
        return analyse_insertion(trial, profile, settings, expected)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        return Analysed(trial, problem=str(problem))
