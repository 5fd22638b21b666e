"""The coefficients of a mud from the trials of a load cell, by the words of experiments/load_cell_truth.py.

    k_p    F = k V(z) by least squares over the way down, every piece of way alike
    k_e    the same for the last three quarters of the way up, with the force downward
    k_s    F = k ∫ζ dA at the set depth, F the mean over the second half of the way

V is the submerged volume of the upright plate and ∫ζ dA the first moment of its face (control/plate.py). What the mud
bears less while the stage slows down is added back, so a coefficient belongs to the speed of the stage.

A stage moves alike in all trials, so its speed and its ramps are found in each and then fitted again near their median.
The doubt of one trial holds that of speed, surface and samples, and what the law leaves over. A mud has two: that of
its trials, which is their scatter or their own doubt where that is more, and that of the bench, which no trial shows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot, isfinite, nan, sqrt
from statistics import fmean, median, stdev
from typing import NamedTuple

import numpy as np

from control.plate import submerged_part
from estimation.origin_fit import fit_through_origin
from experiments.curve_fit import Array
from experiments.loadcell_contact import Course, StrokeError, find_contact, without_spikes
from experiments.loadcell_motion import (
    RATE_EXPONENT,
    REVERSAL_SHARE,
    YIELD_M,
    Extraction,
    Insertion,
    Pace,
    Shear,
    StageSettings,
    descent,
    find_extraction,
    find_insertion,
    find_shear,
    wide_pace,
)
from experiments.side_by_side import Show

SHEAR, INSERTION = "shear", "insertion"
KINDS = (SHEAR, INSERTION)
COEFFICIENTS = ("k_p", "k_s", "k_e")
SPEED_BOUND = 0.05  # from the one that was set, beyond which it is said
SINGLE_SPEED_BOUND = 0.12  # the same of a single trial, before it is known beside the others
LEAST_SPEED_DOUBT, LEAST_RAMP_DOUBT = 0.005, 0.1  # of a stage, from trial to trial
SET_SPEED_DOUBT = 0.01  # of a stage's controller
MEDIAN_ERROR = 1.25  # times that of a mean
AGREEING = 3.0  # standard errors
RESIDUAL_NOISES, RESIDUAL_SHARE = 4.0, 0.03
BLOCKS = 8  # of a steady shear, whose means tell its scatter
NORMAL_MAD = 1.4826
DEPTH_POWERS = {"k_p": 1.0, "k_s": 2.0, "k_e": 1.0}  # with which a depth that was set wrong enters
CALLIPERS_M = 0.05e-3


class Coefficient(NamedTuple):
    """N/m³; NaN where the trial says nothing."""

    value: float
    std_error: float


NOT_KNOWN = Coefficient(nan, nan)


class Recorded(NamedTuple):
    """The samples of one trial, less those that are no force, and the zero with the plate clear of the mud."""

    key: str
    mud: str
    kind: str
    times_s: Array
    forces_n: Array
    zero_n: float


@dataclass(frozen=True)
class Analysed:
    """One trial: what was found in it."""

    recorded: Recorded
    course: Course | None = None
    motion: Insertion | Shear | None = None
    extraction: Extraction | None = None
    coefficients: Mapping[str, Coefficient] = field(default_factory=dict)
    problem: str = ""  # why there is no coefficient
    remark: str = ""
    shared_doubt: float = 0.0  # of the speed, as a share, which all trials of a stage have alike

    @property
    def pace(self) -> Pace | None:
        return self.motion.pace if isinstance(self.motion, Insertion) else None

    @property
    def speed_m_s(self) -> float | None:
        """Of the stage, as found; a shear tells it roughly, from when the force began and fell."""
        if isinstance(self.motion, Shear):
            return self.motion.speed_m_s
        return None if self.pace is None else self.pace.speed_m_s


class OfMud(NamedTuple):
    """One coefficient of one mud, with the standard errors that its trials tell and those of the bench."""

    value: float
    trials_error: float
    trials: tuple[float, ...]
    repeatability: float  # scatter of the trials over their mean
    bench_error: float = 0.0

    @property
    def std_error(self) -> float:
        return hypot(self.trials_error, self.bench_error)


def analyse(trials: Sequence[Recorded], settings: StageSettings, show: Show) -> list[Analysed]:
    """All trials of one stage; the second time near its median pace."""
    first = []
    for done, trial in enumerate(trials):
        show(done, len(trials))
        first.append(analyse_trial(trial, settings, wide_pace(settings)))
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


def analyse_trial(trial: Recorded, settings: StageSettings, expected: Pace) -> Analysed:
    try:
        course = find_contact(trial.times_s, without_spikes(trial.forces_n))
        analysed = _shear if trial.kind == SHEAR else _insertion
        return analysed(trial, course, settings, expected)
    except (StrokeError, np.linalg.LinAlgError) as problem:
        return Analysed(trial, problem=str(problem))


def volume_m3(settings: StageSettings, depths_m: Array) -> Array:
    plate = settings.plate
    areas_m2 = [submerged_part(plate, float(depth_m), 0.0, 1.0).area_m2 for depth_m in depths_m]
    return plate.plate_thickness_m * np.array(areas_m2)


def _insertion(trial: Recorded, course: Course, settings: StageSettings, expected: Pace) -> Analysed:
    motion = find_insertion(course, settings, expected)
    told = {"k_p": _k_p(course, motion, settings)}
    extraction, remark = None, _course_remark(course, motion)
    try:
        extraction = find_extraction(course, motion, settings)
        told["k_e"] = _k_e(course, motion, extraction, settings)
    except StrokeError as problem:
        told["k_e"], remark = NOT_KNOWN, str(problem)
    return Analysed(trial, course, motion, extraction, told, "", remark)


def _course_remark(course: Course, motion: Insertion) -> str:
    largest_n = motion.jump_n + motion.rise_n
    if motion.residual_n <= max(RESIDUAL_NOISES * course.noise_n, RESIDUAL_SHARE * largest_n):
        return ""
    return (
        f"the force is {motion.residual_n:.3f} N off the course of a stage of one speed: it stuttered, was moved by "
        "hand, or the mud has lumps, and its depth is in doubt"
    )


def _k_p(course: Course, motion: Insertion, settings: StageSettings) -> Coefficient:
    since_s = course.times_s - motion.surface_s
    pace, depth_m = motion.pace, settings.depth_m
    depths_m, shares = descent(since_s, pace.speed_m_s, pace.acceleration_m_s2, depth_m)
    inside = (depths_m > 0.0) & (course.times_s < motion.stop_s)
    wet = np.clip(depths_m / YIELD_M, 0.0, 1.0)
    forces_n = course.forces_n - motion.level_n - motion.slowing_n * wet * (1.0 - shares**RATE_EXPONENT)
    ways_m = np.clip(np.gradient(depths_m), 1e-9, None)
    shift = 1.5 * pace.speed_m_s * motion.surface_std_error_s / depth_m
    return _slope(settings, depths_m[inside], forces_n[inside], ways_m[inside], hypot(shift, pace.speed_doubt))


def _k_e(course: Course, motion: Insertion, extraction: Extraction, settings: StageSettings) -> Coefficient:
    pace = motion.pace
    left_s = extraction.out_s - course.times_s
    depths_m, _ = descent(left_s, pace.speed_m_s, pace.acceleration_m_s2, settings.depth_m)
    inside = (depths_m > 0.0) & (depths_m <= (1.0 - REVERSAL_SHARE) * settings.depth_m)
    forces_n = extraction.level_n - course.forces_n
    ways_m = np.clip(-np.gradient(depths_m), 1e-9, None)
    return _slope(settings, depths_m[inside], forces_n[inside], ways_m[inside], pace.speed_doubt)


def _slope(settings: StageSettings, depths_m: Array, forces_n: Array, ways_m: Array, doubt: float) -> Coefficient:
    """k of F = k V, with the doubt of samples that hang together; `doubt` is that of the depths' course."""
    volumes_m3, roots = volume_m3(settings, depths_m), np.sqrt(ways_m)
    square = float(np.sum(ways_m * volumes_m3 * volumes_m3))
    fit = fit_through_origin((roots * volumes_m3).tolist(), (roots * forces_n).tolist())
    if fit is None or not square > 0.0:
        raise StrokeError(
            "fewer than 4 samples in the mud: the stage stopped on its way or was moved by hand, or a faster amplifier "
            "or a slower stage is needed"
        )
    value = float(np.sum(ways_m * volumes_m3 * forces_n)) / square
    if value <= 0.0:
        raise StrokeError("the force does not oppose the motion")
    return Coefficient(value, hypot(fit.std_error, doubt * value))


def _shear(trial: Recorded, course: Course, settings: StageSettings, expected: Pace) -> Analysed:
    zero_n = -trial.zero_n if course.turned else trial.zero_n
    motion = find_shear(course, settings, zero_n)
    steady = (course.times_s >= motion.steady_from_s) & (course.times_s <= motion.steady_to_s)
    forces_n = course.forces_n[steady] - zero_n
    moment_m3 = submerged_part(settings.plate, settings.depth_m, 0.0, 1.0).depth_moment_m3
    blocks_n = [float(np.mean(block)) for block in np.array_split(forces_n, BLOCKS)]
    error_n = stdev(blocks_n) / sqrt(BLOCKS)
    told = Coefficient(float(np.mean(forces_n)) / moment_m3, error_n / moment_m3)
    tilt = (blocks_n[-1] - blocks_n[0]) / fmean(blocks_n)
    remark = f"the shear was not steady: it changed by {100.0 * tilt:+.0f} %" if abs(tilt) > 0.15 else ""
    return Analysed(trial, course, motion, None, {"k_s": told}, "", remark)


def bench_doubt(name: str, settings: StageSettings, depth_error_m: float, calibration_error: float) -> float:
    """Of a coefficient, as a share: what depth, callipers and calibration make alike in all trials."""
    depth = DEPTH_POWERS[name] * depth_error_m / settings.depth_m
    width = CALLIPERS_M / settings.plate_width_m
    thickness = 0.0 if name == "k_s" else CALLIPERS_M / settings.plate_thickness_m
    return hypot(depth, width, thickness, calibration_error)


def of_mud(trials: Sequence[Analysed], name: str, bench: float) -> OfMud:
    """`bench`: the doubt of the bench as a share."""
    shared = max((trial.shared_doubt for trial in trials if name in trial.coefficients), default=0.0)
    told = [trial.coefficients[name] for trial in trials if name in trial.coefficients]
    told = [each for each in told if isfinite(each.value)]
    if not told:
        return OfMud(nan, nan, (), nan)
    values = [each.value for each in told]
    mean, own = fmean(values), sqrt(fmean([each.std_error**2 for each in told]) / len(told))
    scatter = stdev(values) if len(values) > 1 else nan
    doubt = max(own, scatter / sqrt(len(values))) if len(values) > 1 else own
    return OfMud(mean, hypot(doubt, shared * mean), tuple(values), scatter / mean, bench * mean)


def depths_of(trial: Analysed, settings: StageSettings) -> Array | None:
    """The course of the depth, as found; None where it was not."""
    motion, extraction = trial.motion, trial.extraction
    if trial.course is None or not isinstance(motion, Insertion):
        return None
    times_s, depth_m, pace = trial.course.times_s, settings.depth_m, motion.pace
    down_m, _ = descent(times_s - motion.surface_s, pace.speed_m_s, pace.acceleration_m_s2, depth_m)
    if extraction is None:
        return down_m
    up_m, _ = descent(extraction.out_s - times_s, pace.speed_m_s, pace.acceleration_m_s2, depth_m)
    return np.minimum(down_m, up_m)


def speed_remark(pace: Pace, settings: StageSettings, bound: float = SPEED_BOUND) -> str:
    ratio = pace.speed_m_s / settings.speed_m_s
    if abs(ratio - 1.0) <= max(bound, 2.0 * pace.speed_doubt):
        return ""
    return (
        f"the stage moved at {pace.speed_m_s:.3f} m/s, and {settings.speed_m_s:.3f} m/s was set: the depth's course is "
        "the measured one, but mud bears more the faster it is; check the stage's speed and the depth it was set to"
    )
