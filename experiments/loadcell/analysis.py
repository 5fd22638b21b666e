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
from experiments.loadcell.contact import Course, StrokeError, find_contact, without_spikes
from experiments.loadcell.fits import SHEAR, SHIFT, Analysed, Recorded, analyse_insertion, analyse_shear
from experiments.loadcell.measured import analyse_measured
from experiments.loadcell.motion import Insertion, Pace, StageSettings, wide_pace
from experiments.reports.side_by_side import Show

LEAST_SPEED_DOUBT, LEAST_RAMP_DOUBT = 0.005, 0.1  # of a stage, from trial to trial
SET_SPEED_DOUBT = 0.01  # of a stage's controller
AGREEING = 3.0  # standard errors


def analyse(trials: Sequence[Recorded], settings: StageSettings, show: Show) -> list[Analysed]:
    """All trials of one stage; the second time near what they have in common."""
    first = []
    for done, trial in enumerate(trials):
        show(done, len(trials))
        first.append(analyse_trial(trial, settings, wide_pace(settings)))
    return _again_by_force(_again_by_place(first, settings), settings)


def _again_by_place(first: Sequence[Analysed], settings: StageSettings) -> list[Analysed]:
    aligned = [told.alignment for told in first if told.alignment is not None]
    common = common_alignment(aligned)
    pace = wide_pace(settings)
    again = [analyse_trial(told.recorded, settings, pace, common) if told.is_measured else told for told in first]
    return [
        replace(told, shared_doubt=hypot(told.shared_doubt, _of_lag(told, common, settings)))
        if told.is_measured
        else told
        for told in again
    ]


def _of_lag(told: Analysed, common: Alignment, settings: StageSettings) -> float:
    """What a lag that all trials have wrong alike makes of a depth, as a share of the coefficient."""
    speed_m_s = told.speed_m_s if isinstance(told.motion, Insertion) else None
    own_s = told.alignment.lag_doubt_s if told.alignment is not None else 0.0
    return SHIFT * (speed_m_s or 0.0) * min(common.lag_doubt_s, own_s) / settings.depth_m


def _again_by_force(first: list[Analysed], settings: StageSettings) -> list[Analysed]:
    paces = [told.pace for told in first if told.pace is not None]
    if len(paces) < 3:
        return first
    common, doubt = common_pace(paces, settings)
    again = [analyse_trial(told.recorded, settings, common) if told.pace else told for told in first]
    return [replace(told, shared_doubt=doubt) if told.pace else told for told in again]


def common_pace(paces: Sequence[Pace], settings: StageSettings) -> tuple[Pace, float]:
    """The median of a stage's trials, and what they scatter beyond their own doubts. The speed that was set counts as
    a measurement of its own, unless the trials say that it was another. And the doubt of that speed, which grows where
    the two do not agree.
    """
    speeds, doubts = [pace.speed_m_s for pace in paces], [pace.speed_doubt for pace in paces]
    speed, scatter = _common(speeds, doubts)
    error = MEDIAN_ERROR * max(stdev(speeds) / speed, median(doubts), LEAST_SPEED_DOUBT) / sqrt(len(paces))
    apart = abs(speed / settings.speed_m_s - 1.0) / hypot(error, SET_SPEED_DOUBT)
    if apart < AGREEING:
        told, own = 1.0 / SET_SPEED_DOUBT**2, 1.0 / error**2
        speed = (told * settings.speed_m_s + own * speed) / (told + own)
        error = max(1.0, apart) / sqrt(told + own)
    ramp, ramp_scatter = _common(
        [pace.acceleration_m_s2 for pace in paces], [pace.acceleration_doubt for pace in paces]
    )
    return Pace(speed, ramp, max(LEAST_SPEED_DOUBT, scatter, error), max(LEAST_RAMP_DOUBT, ramp_scatter)), error


def _common(values: Sequence[float], doubts: Sequence[float]) -> tuple[float, float]:
    return median(values), sqrt(max(0.0, _scatter(values) ** 2 - median(doubts) ** 2))


def _scatter(values: Sequence[float]) -> float:
    """As a share, whatever single ones do."""
    middle = median(values)
    return NORMAL_MAD * median(abs(value / middle - 1.0) for value in values)


def analyse_trial(trial: Recorded, settings: StageSettings, expected: Pace, aligned: Alignment = WIDE) -> Analysed:
    try:
        course = find_contact(trial.times_s, without_spikes(trial.forces_n))
    except StrokeError as problem:
        return Analysed(trial, problem=str(problem))
    if trial.places is None:
        return _by_force(trial, course, settings, expected)
    try:
        return analyse_measured(trial, course, settings, aligned)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        told = _by_force(trial, course, settings, expected)
        return replace(told, remark=f"the place is not used: {problem}")


def _by_force(trial: Recorded, course: Course, settings: StageSettings, expected: Pace) -> Analysed:
    try:
        if trial.kind == SHEAR:
            return analyse_shear(trial, course, settings)
        return analyse_insertion(trial, course, settings, expected)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        return Analysed(trial, problem=str(problem))
