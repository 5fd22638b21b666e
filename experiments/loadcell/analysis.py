"""From recorded trials to the coefficients of muds, with measured positions or from the force alone.

All trials have the same stage and devices: speed and ramps, or an encoder's lag, are found in each trial and then
fitted again near the median of all. A mud has two errors: that of its trials (their scatter, or their own errors where
these are larger) and that of the bench, which no trial shows.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, isfinite, nan, sqrt
from statistics import fmean, median, stdev
from typing import NamedTuple

import numpy as np

from estimation.strokes.origin_fit import NORMAL_MAD, student_factor
from experiments.loadcell.force_trials import analyse_insertion, analyse_shear
from experiments.loadcell.measured_trials import analyse_measured
from experiments.loadcell.stage_track import MEDIAN_ERROR, WIDE, common_alignment
from experiments.loadcell.strokes import (
    SHEAR,
    SHIFT,
    Alignment,
    AnalysedTrial,
    Coefficient,
    Pace,
    Recorded,
    StageSettings,
    StrokeError,
    find_contact,
)
from experiments.study.session import Show

LEAST_SPEED_UNCERTAINTY, LEAST_RAMP_UNCERTAINTY = 0.005, 0.1  # of a stage, from trial to trial
SET_SPEED_UNCERTAINTY = 0.01  # of a stage's controller
AGREEING = 3.0  # standard errors
SPEED_BOUND = 0.05  # difference from the set speed that is remarked
DEPTH_POWERS = {"k_p": 1.0, "k_s": 2.0, "k_e": 1.0}  # powers with which an error of the set depth enters
CALLIPERS_M = 0.05e-3


class MudCoefficient(NamedTuple):
    """One coefficient of one mud, with the standard errors of its trials and of the bench."""

    value: float
    trials_error: float
    trials: tuple[float, ...]
    repeatability: float  # standard deviation of the trials over their mean
    shared_error: float = 0.0

    @property
    def std_error(self) -> float:
        return hypot(self.trials_error, self.shared_error)


def analyse(trials: Sequence[Recorded], show: Show) -> list[AnalysedTrial]:
    """Analyse all trials of one stage, the second time near their common values."""
    analysed = []
    for done, trial in enumerate(trials):
        show(done, len(trials))
        analysed.append(analyse_trial(trial))
    common = common_alignment([trial.alignment for trial in analysed if trial.alignment is not None])
    analysed = [_realigned(trial.recorded, common) if trial.is_measured else trial for trial in analysed]
    paces = [trial.pace for trial in analysed if trial.pace is not None]
    if len(paces) < 3:
        return analysed
    pace, uncertainty = common_pace(paces, trials[0].settings.speed_m_s)
    return [
        replace(analyse_trial(trial.recorded, pace), shared_uncertainty=uncertainty) if trial.pace else trial
        for trial in analysed
    ]


def _realigned(trial: Recorded, common: Alignment) -> AnalysedTrial:
    """Analyse again, and add the relative error from the lag that all trials share."""
    again = analyse_trial(trial, aligned=common)
    if again.alignment is None or again.speed_m_s is None or trial.kind == SHEAR:
        return again
    lag_s = min(common.lag_uncertainty_s, again.alignment.lag_uncertainty_s)
    shared = SHIFT * again.speed_m_s * lag_s / trial.settings.depth_m
    return replace(again, shared_uncertainty=hypot(again.shared_uncertainty, shared))


def common_pace(paces: Sequence[Pace], set_m_s: float) -> tuple[Pace, float]:
    """Return the median of the trials' speeds and ramps with their scatter, and the uncertainty of the speed.

    The set speed counts as a measurement of its own, unless the trials contradict it; the uncertainty grows where
    the two do not agree.
    """
    speeds, ramps, speed_errors, ramp_errors = zip(*paces, strict=True)
    speed, scatter = _common(speeds, speed_errors)
    error = MEDIAN_ERROR * max(stdev(speeds) / speed, median(speed_errors), LEAST_SPEED_UNCERTAINTY) / sqrt(len(paces))
    apart = abs(speed / set_m_s - 1.0) / hypot(error, SET_SPEED_UNCERTAINTY)
    if apart < AGREEING:
        prior, own = 1.0 / SET_SPEED_UNCERTAINTY**2, 1.0 / error**2
        speed = (prior * set_m_s + own * speed) / (prior + own)
        error = max(1.0, apart) / sqrt(prior + own)
    ramp, ramp_scatter = _common(ramps, ramp_errors)
    speed_uncertainty = max(LEAST_SPEED_UNCERTAINTY, scatter, error)
    return Pace(speed, ramp, speed_uncertainty, max(LEAST_RAMP_UNCERTAINTY, ramp_scatter)), error


def _common(values: Sequence[float], uncertainties: Sequence[float]) -> tuple[float, float]:
    """Return the median, and the relative scatter between trials: robust to outliers, less their own uncertainty."""
    middle = median(values)
    scatter = NORMAL_MAD * median(abs(value / middle - 1.0) for value in values)
    return middle, sqrt(max(0.0, scatter**2 - median(uncertainties) ** 2))


def analyse_trial(trial: Recorded, expected: Pace | None = None, aligned: Alignment = WIDE) -> AnalysedTrial:
    """Evaluate the positions, or the force alone where there are none or they do not show the stroke."""
    remark = ""
    try:
        profile = find_contact(trial)
        if trial.positions is not None:
            try:
                return analyse_measured(trial, profile, aligned)
            except (StrokeError, np.linalg.LinAlgError) as problem:
                remark = f"the position is not used: {problem}"
        analysed = analyse_shear(trial, profile) if trial.kind == SHEAR else analyse_insertion(trial, profile, expected)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        analysed = AnalysedTrial(trial, problem=str(problem))
    return replace(analysed, remark=remark or analysed.remark)


def bench_uncertainty(name: str, settings: StageSettings, depth_error_m: float, calibration_error: float) -> float:
    """Return the fraction by which depth, callipers and calibration move a coefficient alike in all trials."""
    depth = DEPTH_POWERS[name] * depth_error_m / settings.depth_m
    width = CALLIPERS_M / settings.plate_width_m
    thickness = 0.0 if name == "k_s" else CALLIPERS_M / settings.plate_thickness_m
    return hypot(depth, width, thickness, calibration_error)


def gather_trials(trials: Sequence[AnalysedTrial], name: str, bench: float) -> MudCoefficient:
    """Combine the trials of one mud. `bench` is the fraction by which the bench may err.

    An error that all trials share does not average out, but it moves their mean by no more than the mean of its
    effects.
    """
    valid = [trial for trial in trials if isfinite(trial.coefficients.get(name, Coefficient()).value)]
    if not valid:
        return MudCoefficient(value=nan, trials_error=nan, trials=(), repeatability=nan)
    values, errors = zip(*(trial.coefficients[name] for trial in valid), strict=True)
    mean, uncertainty = fmean(values), sqrt(fmean([error**2 for error in errors]) / len(errors))
    scatter = stdev(values) if len(values) > 1 else nan
    if len(values) > 1:
        uncertainty = max(uncertainty, student_factor(len(values) - 1) * scatter / sqrt(len(values)))
    shared = fmean(trial.shared_uncertainty for trial in valid)
    return MudCoefficient(
        value=mean,
        trials_error=hypot(uncertainty, shared * mean),
        trials=values,
        repeatability=scatter / mean,
        shared_error=bench * mean,
    )


def speed_remark(trial: AnalysedTrial, bound: float = SPEED_BOUND) -> str:
    """Return a remark on a stage that did not move at the set speed, as far as the force shows its pace."""
    set_m_s, pace = trial.recorded.settings.speed_m_s, trial.pace
    if pace is None or abs(pace.speed_m_s / set_m_s - 1.0) <= max(bound, 2.0 * pace.speed_uncertainty):
        return ""
    return f"the stage moved at {pace.speed_m_s:.3f} m/s, and {set_m_s:.3f} m/s was set: check both"
