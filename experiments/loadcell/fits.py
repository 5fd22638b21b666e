"""The coefficients of a mud from the trials of a load cell, by the words of experiments/trials/load_cell_truth.py.

    k_p    F = k V(z) by least squares over the way down, every piece of way alike
    k_e    the same for the last three quarters of the way up, with the force downward
    k_s    F = k ∫ζ dA at the set depth, F the mean over the second half of the way

V is the submerged volume of the upright plate and ∫ζ dA the first moment of its face (control/plate.py). What the mud
bears less while the stage slows down is added back, so a coefficient belongs to the speed of the stage.

The doubt of one trial holds that of speed, surface and samples. What the law leaves over of the mud's course is none:
another trial leaves the same. A mud has two doubts: that of its trials, which is their scatter or their own doubt where
that is more, and that of the bench, which no trial shows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, isfinite, nan, sqrt
from statistics import fmean, stdev
from typing import NamedTuple

import numpy as np

from control.plate import submerged_part
from estimation.strokes.origin_fit import MIN_BATCHES, student_factor
from experiments.loadcell.alignment import Alignment
from experiments.loadcell.contact import Profile, StrokeError
from experiments.loadcell.curve_fit import Array
from experiments.loadcell.motion import (
    RATE_EXPONENT,
    REVERSAL_FRACTION,
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
)
from experiments.loadcell.stage_track import Places

SHEAR, INSERTION = "shear", "insertion"
KINDS = (SHEAR, INSERTION)
COEFFICIENTS = ("k_p", "k_s", "k_e")
SPEED_BOUND = 0.05  # from the one that was set, beyond which it is said
SINGLE_SPEED_BOUND = 0.12  # the same of a single trial, before it is known beside the others
RESIDUAL_NOISES, RESIDUAL_FRACTION = 4.0, 0.03
BLOCKS = 8  # of a steady shear, whose means tell its scatter
UNSTEADY = 0.15  # change over a steady shear, from which it is said
DEPTH_POWERS = {"k_p": 1.0, "k_s": 2.0, "k_e": 1.0}  # with which a depth that was set wrong enters
CALLIPERS_M = 0.05e-3
SHIFT = 1.5  # of k, for all depths of a stroke that are wrong alike, in shares of the deepest one


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
    places: Places | None = None  # of the stage, where an encoder told them throughout


@dataclass(frozen=True)
class Analysed:
    """One trial: what was found in it."""

    recorded: Recorded
    profile: Profile | None = None
    motion: Insertion | Shear | None = None
    extraction: Extraction | None = None
    coefficients: Mapping[str, Coefficient] = field(default_factory=dict)
    problem: str = ""  # why there is no coefficient
    remark: str = ""
    shared_uncertainty: float = 0.0  # of speed, lag or rate, as a share, which all trials of a stage have alike
    positions_m: Array | None = None  # depths of an insertion, ways of a shear, as an encoder measured them
    position_error_m: float = 0.0  # of them, one standard error
    alignment: Alignment | None = None  # of an encoder and the cell

    @property
    def is_measured(self) -> bool:
        return self.positions_m is not None

    @property
    def pace(self) -> Pace | None:
        """As the force tells it."""
        return self.motion.pace if isinstance(self.motion, Insertion) and not self.is_measured else None

    @property
    def speed_m_s(self) -> float | None:
        """Of the stage, as found; without an encoder a shear tells it roughly, from when the force began and fell."""
        if isinstance(self.motion, Shear):
            return self.motion.speed_m_s
        return None if self.motion is None else self.motion.pace.speed_m_s


class OfMud(NamedTuple):
    """One coefficient of one mud, with the standard errors that its trials tell and those of the bench."""

    value: float
    trials_error: float
    trials: tuple[float, ...]
    repeatability: float  # scatter of the trials over their mean
    shared_error: float = 0.0

    @property
    def std_error(self) -> float:
        return hypot(self.trials_error, self.shared_error)


def volume_m3(settings: StageSettings, depths_m: Array) -> Array:
    plate = settings.plate
    areas_m2 = [submerged_part(plate, float(depth_m), 0.0, 1.0).area_m2 for depth_m in depths_m]
    return plate.plate_thickness_m * np.array(areas_m2)


def analyse_insertion(trial: Recorded, profile: Profile, settings: StageSettings, expected: Pace) -> Analysed:
    motion = find_insertion(profile, settings, expected)
    reported = {"k_p": _k_p(profile, motion, settings)}
    extraction, remark = None, _profile_remark(profile, motion)
    try:
        extraction = find_extraction(profile, motion, settings)
        reported["k_e"] = _k_e(profile, motion, extraction, settings)
    except StrokeError as problem:
        reported["k_e"], remark = NOT_KNOWN, str(problem)
    return Analysed(trial, profile, motion, extraction, reported, "", remark)


def _profile_remark(profile: Profile, motion: Insertion) -> str:
    largest_n = motion.jump_n + motion.rise_n
    if motion.residual_n <= max(RESIDUAL_NOISES * profile.noise_n, RESIDUAL_FRACTION * largest_n):
        return ""
    return (
        f"the force is {motion.residual_n:.3f} N off the course of a stage of one speed: it stuttered, was moved by "
        "hand, or the mud has lumps, and its depth is in doubt"
    )


def _k_p(profile: Profile, motion: Insertion, settings: StageSettings) -> Coefficient:
    since_s = profile.times_s - motion.surface_s
    pace, depth_m = motion.pace, settings.depth_m
    depths_m, fractions = descent(since_s, pace.speed_m_s, pace.acceleration_m_s2, depth_m)
    wet = np.clip(depths_m / YIELD_M, 0.0, 1.0)
    forces_n = profile.forces_n - motion.level_n - motion.slowing_n * wet * (1.0 - fractions**RATE_EXPONENT)
    shift = SHIFT * pace.speed_m_s * motion.surface_std_error_s / depth_m
    return slope(settings, depths_m, forces_n, depth_m, hypot(shift, pace.speed_uncertainty))


def _k_e(profile: Profile, motion: Insertion, extraction: Extraction, settings: StageSettings) -> Coefficient:
    pace = motion.pace
    left_s = extraction.out_s - profile.times_s
    depths_m, _ = descent(left_s, pace.speed_m_s, pace.acceleration_m_s2, settings.depth_m)
    forces_n, to_m = extraction.level_n - profile.forces_n, (1.0 - REVERSAL_FRACTION) * settings.depth_m
    shift = SHIFT * pace.speed_m_s * extraction.out_std_error_s / to_m
    return slope(settings, depths_m, forces_n, to_m, hypot(shift, pace.speed_uncertainty))


def slope(settings: StageSettings, depths_m: Array, forces_n: Array, to_m: float, uncertainty: float) -> Coefficient:
    """k of F = k V from the surface to `to_m`, samples meeting half-way. That F is not k V is no doubt: k is what least
    squares make of the mud's own course. `doubt` is that of the depths.
    """
    middles_m = (depths_m[1:] + depths_m[:-1]) / 2.0
    ways_m = np.abs(np.diff(np.clip(np.concatenate([depths_m[:1], middles_m, depths_m[-1:]]), 0.0, to_m)))
    inside = ways_m > 0.0
    depths_m, forces_n, ways_m = depths_m[inside], forces_n[inside], ways_m[inside]
    volumes_m3 = volume_m3(settings, depths_m)
    square = float(np.sum(ways_m * volumes_m3 * volumes_m3))
    if len(depths_m) < MIN_BATCHES or not square > 0.0:
        raise StrokeError(
            "fewer than 4 samples in the mud: the stage stopped on its way or was moved by hand, or a faster amplifier "
            "or a slower stage is needed"
        )
    value = float(np.sum(ways_m * volumes_m3 * forces_n)) / square
    if value <= 0.0:
        raise StrokeError("the force does not oppose the motion")
    reported = noises_n(depths_m, forces_n) * (ways_m * volumes_m3)[1:-1]
    noise = (
        student_factor(len(reported))
        * float(np.sqrt(np.sum(reported * reported) * len(depths_m) / len(reported)))
        / square
    )
    return Coefficient(value, hypot(noise, uncertainty * value))


def noises_n(depths_m: Array, forces_n: Array) -> Array:
    """Of all samples but the first and the last: what each is off the line through its neighbours, over the scatter
    of such a difference of independent ones (Gasser, Sroka and Jennen-Steinmetz 1986).
    """
    ways_m = np.abs(np.diff(depths_m))
    after = ways_m[:-1] / np.clip(ways_m[:-1] + ways_m[1:], 1e-12, None)
    apart_n = forces_n[1:-1] - (1.0 - after) * forces_n[:-2] - after * forces_n[2:]
    return np.asarray(apart_n / np.sqrt(1.0 + (1.0 - after) ** 2 + after**2))


def analyse_shear(trial: Recorded, profile: Profile, settings: StageSettings) -> Analysed:
    zero_n = -trial.zero_n if profile.turned else trial.zero_n
    motion = find_shear(profile, settings, zero_n)
    steady = (profile.times_s >= motion.steady_from_s) & (profile.times_s <= motion.steady_to_s)
    forces_n = profile.forces_n[steady] - zero_n
    moment_m3 = submerged_part(settings.plate, settings.depth_m, 0.0, 1.0).depth_moment_m3
    error_n, remark = steadiness(forces_n)
    reported = Coefficient(float(np.mean(forces_n)) / moment_m3, error_n / moment_m3)
    return Analysed(trial, profile, motion, None, {"k_s": reported}, "", remark)


def steadiness(forces_n: Array) -> tuple[float, str]:
    """Standard error of the mean of a shear's force, by the means of blocks, and what is to be said of it."""
    blocks_n = [float(np.mean(block)) for block in np.array_split(forces_n, BLOCKS)]
    tilt = (blocks_n[-1] - blocks_n[0]) / fmean(blocks_n)
    remark = f"the shear was not steady: it changed by {100.0 * tilt:+.0f} %" if abs(tilt) > UNSTEADY else ""
    return student_factor(BLOCKS - 1) * stdev(blocks_n) / sqrt(BLOCKS), remark


def bench_uncertainty(name: str, settings: StageSettings, depth_error_m: float, calibration_error: float) -> float:
    """Of a coefficient, as a share: what depth, callipers and calibration make alike in all trials."""
    depth = DEPTH_POWERS[name] * depth_error_m / settings.depth_m
    width = CALLIPERS_M / settings.plate_width_m
    thickness = 0.0 if name == "k_s" else CALLIPERS_M / settings.plate_thickness_m
    return hypot(depth, width, thickness, calibration_error)


def of_mud(trials: Sequence[Analysed], name: str, bench: float) -> OfMud:
    """`bench`: the doubt of the bench as a share. What trials have alike does not average out, but moves their mean by
    no more than the mean of what it moves each of them.
    """
    valid = [trial for trial in trials if isfinite(trial.coefficients.get(name, NOT_KNOWN).value)]
    if not valid:
        return OfMud(nan, nan, (), nan)
    reported, shared = [trial.coefficients[name] for trial in valid], fmean(trial.shared_uncertainty for trial in valid)
    values = [each.value for each in reported]
    mean, own = fmean(values), sqrt(fmean([each.std_error**2 for each in reported]) / len(reported))
    scatter = stdev(values) if len(values) > 1 else nan
    uncertainty = max(own, student_factor(len(values) - 1) * scatter / sqrt(len(values))) if len(values) > 1 else own
    return OfMud(mean, hypot(uncertainty, shared * mean), tuple(values), scatter / mean, bench * mean)


def depths_of(trial: Analysed, settings: StageSettings) -> Array | None:
    """The course of the depth, as found; None where it was not."""
    motion, extraction = trial.motion, trial.extraction
    if trial.profile is None or not isinstance(motion, Insertion):
        return None
    if trial.positions_m is not None:
        return trial.positions_m
    times_s, depth_m, pace = trial.profile.times_s, settings.depth_m, motion.pace
    down_m, _ = descent(times_s - motion.surface_s, pace.speed_m_s, pace.acceleration_m_s2, depth_m)
    if extraction is None:
        return down_m
    up_m, _ = descent(extraction.out_s - times_s, pace.speed_m_s, pace.acceleration_m_s2, depth_m)
    return np.minimum(down_m, up_m)


def speed_remark(pace: Pace, settings: StageSettings, bound: float = SPEED_BOUND) -> str:
    ratio = pace.speed_m_s / settings.speed_m_s
    if abs(ratio - 1.0) <= max(bound, 2.0 * pace.speed_uncertainty):
        return ""
    return (
        f"the stage moved at {pace.speed_m_s:.3f} m/s, and {settings.speed_m_s:.3f} m/s was set: the depth's course is "
        "the measured one, but mud bears more the faster it is; check the stage's speed and the depth it was set to"
    )
