"""Coefficients of a mud from the strokes of a load cell, by the definitions of the paper's section II-E.

    k_p    F = k V(z) by least squares over the way down, with equal weight for equal travel
    k_e    the same for the last three quarters of the way up, with the force downward
    k_s    F = k ∫ζ dA at the set depth, with F the mean over the second half of the travel

V is the submerged volume of the upright plate and ∫ζ dA the first moment of its face (control/plate). Forces are
corrected to the set speed of the stage, to which a coefficient belongs.

The standard error of one trial contains those of speed, surface and samples. The misfit of the law is not part of it,
since another trial leaves the same. A mud has two errors: that of its trials (their scatter, or their own errors where
these are larger) and that of the bench, which no trial shows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, isfinite, nan, sqrt
from statistics import fmean, stdev
from typing import NamedTuple

import numpy as np

from control.plate_integrals import submerged_part
from estimation.strokes.origin_fit import MIN_BATCHES, student_factor
from experiments.loadcell.analysis.contact import Profile, StrokeError
from experiments.loadcell.analysis.curve_fit import Array
from experiments.loadcell.analysis.force_motion import (
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
from experiments.loadcell.analysis.stage_track import Alignment, StagePositions

SHEAR, INSERTION = "shear", "insertion"
KINDS = (SHEAR, INSERTION)
COEFFICIENTS = ("k_p", "k_s", "k_e")
SPEED_BOUND = 0.05  # difference from the set speed that is remarked
SINGLE_SPEED_BOUND = 0.12  # the same for a single trial, whose speed is less certain
RESIDUAL_NOISES, RESIDUAL_FRACTION = 4.0, 0.03
BLOCKS = 8  # of a steady shear
UNSTEADY = 0.15  # change over a steady shear that is remarked
DEPTH_POWERS = {"k_p": 1.0, "k_s": 2.0, "k_e": 1.0}  # powers with which an error of the set depth enters
CALLIPERS_M = 0.05e-3
SHIFT = 1.5  # relative error of k over that of all depths of a stroke, relative to the deepest one


class Coefficient(NamedTuple):
    """A coefficient in N/m³; NaN where the trial does not show it."""

    value: float
    std_error: float


UNKNOWN_COEFFICIENT = Coefficient(nan, nan)


class Recorded(NamedTuple):
    """The valid samples of one trial, and the zero with the plate clear of the mud."""

    key: str
    mud: str
    kind: str
    times_s: Array
    forces_n: Array
    zero_n: float
    positions: StagePositions | None = None  # where an encoder measured the whole stroke


@dataclass(frozen=True)
class AnalysedTrial:
    """The results of one trial."""

    recorded: Recorded
    profile: Profile | None = None
    motion: Insertion | Shear | None = None
    extraction: Extraction | None = None
    coefficients: Mapping[str, Coefficient] = field(default_factory=dict)
    problem: str = ""  # why there is no coefficient
    remark: str = ""
    shared_uncertainty: float = 0.0  # relative, of speed, lag or rate, alike in all trials of a stage
    positions_m: Array | None = None  # measured: depths of an insertion, travel of a shear
    position_error_m: float = 0.0  # one standard error
    alignment: Alignment | None = None  # of an encoder and the cell

    @property
    def is_measured(self) -> bool:
        return self.positions_m is not None

    @property
    def pace(self) -> Pace | None:
        """The speed and ramp that the force shows; nothing where an encoder measured the motion."""
        return self.motion.pace if isinstance(self.motion, Insertion) and not self.is_measured else None

    @property
    def speed_m_s(self) -> float | None:
        """The speed of the stage; a rough one for a shear without an encoder."""
        if isinstance(self.motion, Shear):
            return self.motion.speed_m_s
        return None if self.motion is None else self.motion.pace.speed_m_s


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


def volume_m3(settings: StageSettings, depths_m: Array) -> Array:
    plate = settings.plate
    areas_m2 = [submerged_part(plate, float(depth_m), 0.0, 1.0).area_m2 for depth_m in depths_m]
    return plate.plate_thickness_m * np.array(areas_m2)


def analyse_insertion(trial: Recorded, profile: Profile, settings: StageSettings, expected: Pace) -> AnalysedTrial:
    motion = find_insertion(profile, settings, expected)
    coefficients = {"k_p": _k_p(profile, motion, settings)}
    extraction, remark = None, _profile_remark(profile, motion)
    try:
        extraction = find_extraction(profile, motion, settings)
        coefficients["k_e"] = _k_e(profile, motion, extraction, settings)
    except StrokeError as problem:
        coefficients["k_e"], remark = UNKNOWN_COEFFICIENT, str(problem)
    return AnalysedTrial(trial, profile, motion, extraction, coefficients, "", remark)


def _profile_remark(profile: Profile, motion: Insertion) -> str:
    largest_n = motion.jump_n + motion.rise_n
    if motion.residual_n <= max(RESIDUAL_NOISES * profile.noise_n, RESIDUAL_FRACTION * largest_n):
        return ""
    return f"the force is {motion.residual_n:.3f} N off the curve of a stage of one speed: the depth is uncertain"


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
    """Fit k of F = k V from the surface to `to_m`, with equal weight for equal travel.

    The misfit of the law is no error: k is defined as the least-squares fit to the mud's own curve. `uncertainty` is
    the fraction by which errors of the depth move k.
    """
    middles_m = (depths_m[1:] + depths_m[:-1]) / 2.0
    travels_m = np.abs(np.diff(np.clip(np.concatenate([depths_m[:1], middles_m, depths_m[-1:]]), 0.0, to_m)))
    inside = travels_m > 0.0
    depths_m, forces_n, travels_m = depths_m[inside], forces_n[inside], travels_m[inside]
    volumes_m3 = volume_m3(settings, depths_m)
    square = float(np.sum(travels_m * volumes_m3 * volumes_m3))
    if len(depths_m) < MIN_BATCHES or not square > 0.0:
        raise StrokeError(
            "fewer than 4 samples in the mud: use a faster amplifier or a slower stage that does not stop"
        )
    value = float(np.sum(travels_m * volumes_m3 * forces_n)) / square
    if value <= 0.0:
        raise StrokeError("the force does not oppose the motion")
    noise_n = noises_n(depths_m, forces_n) * (travels_m * volumes_m3)[1:-1]
    noise = (
        student_factor(len(noise_n)) * float(np.sqrt(np.sum(noise_n * noise_n) * len(depths_m) / len(noise_n))) / square
    )
    return Coefficient(value, hypot(noise, uncertainty * value))


def noises_n(depths_m: Array, forces_n: Array) -> Array:
    """Return the noise of all samples but the first and the last.

    Each sample's distance from the line through its neighbours is divided by the scatter of such a distance for
    independent samples (Gasser, Sroka and Jennen-Steinmetz 1986).
    """
    travels_m = np.abs(np.diff(depths_m))
    after = travels_m[:-1] / np.clip(travels_m[:-1] + travels_m[1:], 1e-12, None)
    apart_n = forces_n[1:-1] - (1.0 - after) * forces_n[:-2] - after * forces_n[2:]
    return np.asarray(apart_n / np.sqrt(1.0 + (1.0 - after) ** 2 + after**2))


def analyse_shear(trial: Recorded, profile: Profile, settings: StageSettings) -> AnalysedTrial:
    zero_n = -trial.zero_n if profile.turned else trial.zero_n
    motion = find_shear(profile, settings, zero_n)
    steady = (profile.times_s >= motion.steady_from_s) & (profile.times_s <= motion.steady_to_s)
    forces_n = profile.forces_n[steady] - zero_n
    moment_m3 = submerged_part(settings.plate, settings.depth_m, 0.0, 1.0).depth_moment_m3
    error_n, remark = steadiness(forces_n)
    coefficient = Coefficient(float(np.mean(forces_n)) / moment_m3, error_n / moment_m3)
    return AnalysedTrial(trial, profile, motion, None, {"k_s": coefficient}, "", remark)


def steadiness(forces_n: Array) -> tuple[float, str]:
    """Return the standard error of the mean force of a shear, from the means of blocks, and a remark."""
    blocks_n = [float(np.mean(block)) for block in np.array_split(forces_n, BLOCKS)]
    tilt = (blocks_n[-1] - blocks_n[0]) / fmean(blocks_n)
    remark = f"the shear was not steady: it changed by {100.0 * tilt:+.0f} %" if abs(tilt) > UNSTEADY else ""
    return student_factor(BLOCKS - 1) * stdev(blocks_n) / sqrt(BLOCKS), remark


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
    valid = [trial for trial in trials if isfinite(trial.coefficients.get(name, UNKNOWN_COEFFICIENT).value)]
    if not valid:
        return MudCoefficient(nan, nan, (), nan)
    estimates = [trial.coefficients[name] for trial in valid]
    shared = fmean(trial.shared_uncertainty for trial in valid)
    values = [each.value for each in estimates]
    mean, own = fmean(values), sqrt(fmean([each.std_error**2 for each in estimates]) / len(estimates))
    scatter = stdev(values) if len(values) > 1 else nan
    uncertainty = max(own, student_factor(len(values) - 1) * scatter / sqrt(len(values))) if len(values) > 1 else own
    return MudCoefficient(mean, hypot(uncertainty, shared * mean), tuple(values), scatter / mean, bench * mean)


def depths_of(trial: AnalysedTrial, settings: StageSettings) -> Array | None:
    """Return the depth of each sample, measured or found from the force; nothing where it is unknown."""
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
    return f"the stage moved at {pace.speed_m_s:.3f} m/s, and {settings.speed_m_s:.3f} m/s was set: check both"
