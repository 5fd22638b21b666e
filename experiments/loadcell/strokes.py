"""Strokes of a plate on a load cell: their settings, samples and contact, and what is found in them.

A stroke begins where the force leaves its zero, which may drift before the stage moves. The coefficients follow the
paper's section II-E:

    k_p    F = k V(z) by least squares over the way down, with equal weight for equal travel
    k_e    the same for the last three quarters of the way up, with the force downward
    k_s    F = k ∫ζ dA at the set depth, with F the mean over the second half of the travel

V is the submerged volume of the upright plate and ∫ζ dA the first moment of its face (plate_integrals.py). Forces are
corrected to the set speed of the stage, to which a coefficient belongs. The standard error of one trial contains those
of speed, surface and samples. The misfit of the law is not part of it, since another trial leaves the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot, nan, sqrt
from statistics import fmean, stdev
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.geometry import FlipperGeometry
from control.plate_integrals import submerged_part
from estimation.strokes.origin_fit import MIN_BATCHES, NORMAL_MAD, student_factor
from experiments.loadcell.curve_fit import Array

Mask = NDArray[np.bool_]

SHEAR, INSERTION = "shear", "insertion"
KINDS = (SHEAR, INSERTION)
QUIET_S = 0.4  # before a stroke, for zero and noise
LEAST_NOISE_N = 1e-3
CONTACT_NOISES, CONTACT_FRACTION = 6.0, 0.03  # of the largest force
LEAST_FORCE_N = 0.03
RESTLESS_FRACTION = 0.05  # of the largest force, in noise, that hides the beginning
SPIKE_NOISES = 12.0
RESIDUAL_NOISES, RESIDUAL_FRACTION = 4.0, 0.03
YIELD_M = 0.001  # over which a jump of the force at the surface grows
RATE_EXPONENT = 0.4  # of the force over the speed, as in clay
REVERSAL_FRACTION = 0.25  # of the way up, as in the estimator
BLOCKS = 8  # of a steady shear
UNSTEADY = 0.15  # change over a steady shear that is remarked
SHIFT = 1.5  # relative error of k over that of all depths of a stroke, relative to the deepest one


class StrokeError(Exception):
    """The force does not look like a stroke; the text says what is missing."""


@dataclass(frozen=True)
class StageSettings:
    """The motion that the operator set, and the plate."""

    depth_m: float = 0.03
    speed_m_s: float = 0.1
    hold_s: float = 3.0
    shear_path_m: float = 0.2
    plate_width_m: float = 0.03
    plate_height_m: float = 0.035
    plate_thickness_m: float = 0.004

    @property
    def plate(self) -> FlipperGeometry:
        """The plate; nothing else of this geometry is used."""
        return FlipperGeometry(
            plate_width_m=self.plate_width_m,
            plate_height_m=self.plate_height_m,
            plate_thickness_m=self.plate_thickness_m,
        )

    @property
    def moment_m3(self) -> float:
        """The first moment of the plate's face at the set depth."""
        return submerged_part(self.plate, self.depth_m, 0.0, 1.0).depth_moment_m3

    def volumes_m3(self, depths_m: Array) -> Array:
        """Return the submerged volume of the plate at each depth."""
        areas_m2 = [submerged_part(self.plate, float(depth_m), 0.0, 1.0).area_m2 for depth_m in depths_m]
        return self.plate_thickness_m * np.array(areas_m2)


class StagePositions(NamedTuple):
    """The lines of the stage's encoder."""

    times_s: Array
    positions_m: Array


class Recorded(NamedTuple):
    """The valid samples of one trial, the zero with the plate clear of the mud, and how the stage was set."""

    key: str
    mud: str
    kind: str
    settings: StageSettings
    times_s: Array
    forces_n: Array
    zero_n: float
    positions: StagePositions | None = None  # where an encoder measured the whole stroke

    @property
    def number(self) -> str:
        """The number of the trial, at the end of its key; others of its kind may be left out."""
        return self.key.rpartition("/")[2]


class Profile(NamedTuple):
    """Force against time, with the sign at which mud resists the first motion with a positive force."""

    times_s: Array
    forces_n: Array
    begin: int  # index of the first sample in contact
    level_n: float
    noise_n: float
    turned: bool
    zero_n: float  # with the plate clear of the mud


NO_PROFILE = Profile(
    times_s=np.empty(0), forces_n=np.empty(0), begin=0, level_n=nan, noise_n=nan, turned=False, zero_n=nan
)


class Pace(NamedTuple):
    """Speed and ramp of a stage, with relative uncertainties."""

    speed_m_s: float
    acceleration_m_s2: float
    speed_uncertainty: float = nan
    acceleration_uncertainty: float = nan

    def descent_s(self, depth_m: float) -> float:
        """Return the time from the surface to the stop."""
        return depth_m / self.speed_m_s + self.speed_m_s / (2.0 * self.acceleration_m_s2)

    def descend(self, since_s: Array, depth_m: float) -> tuple[Array, Array]:
        """Return the depth, and the fraction of the full speed, by the time since the surface."""
        left_s = np.clip(self.descent_s(depth_m) - since_s, 0.0, None)
        slowing = left_s < self.speed_m_s / self.acceleration_m_s2
        slow_m = depth_m - self.acceleration_m_s2 * left_s * left_s / 2.0
        return (
            np.where(slowing, slow_m, self.speed_m_s * since_s),
            np.where(slowing, self.acceleration_m_s2 * left_s / self.speed_m_s, 1.0),
        )


class PlateStroke(NamedTuple):
    """One motion of the plate in the mud."""

    begin_s: float
    end_s: float
    level_n: float = 0.0  # the force without mud: before an insertion, after an extraction
    steady_s: float = nan  # time from which the force of a shear counts


class Alignment(NamedTuple):
    """Lag of the forces and rate fraction r with one standard error each (stage_track.py)."""

    lag_s: float  # NaN where a trial does not show it
    rate_fraction: float
    lag_uncertainty_s: float
    rate_uncertainty: float


class Coefficient(NamedTuple):
    """A coefficient in N/m³; NaN where the trial does not show it."""

    value: float = nan
    std_error: float = nan


@dataclass(frozen=True)
class AnalysedTrial:
    """The results of one trial. An insertion has the stroke and the coefficient k_p, and k_e of the way up."""

    recorded: Recorded
    profile: Profile = NO_PROFILE  # where there is no contact
    strokes: Mapping[str, PlateStroke] = field(default_factory=dict)  # by the coefficient that they show
    coefficients: Mapping[str, Coefficient] = field(default_factory=dict)
    problem: str = ""  # why there is no coefficient
    remark: str = ""
    shared_uncertainty: float = 0.0  # relative, of speed, lag or rate, alike in all trials of a stage
    pace: Pace | None = None  # that the force of an insertion shows
    speed_m_s: float | None = None  # of the stage; a rough one for a shear without an encoder
    positions_m: Array | None = None  # measured: depths of an insertion, travel of a shear
    position_error_m: float = 0.0  # one standard error
    alignment: Alignment | None = None  # of an encoder and the cell

    @property
    def is_measured(self) -> bool:
        return self.positions_m is not None


def noise_of(forces_n: Array) -> float:
    """Return the standard deviation of steady forces, robust to outliers."""
    return max(NORMAL_MAD * float(np.median(np.abs(forces_n - np.median(forces_n)))), LEAST_NOISE_N)


def find_contact(trial: Recorded) -> Profile:
    """Find the first sample in contact. Raises StrokeError where there is none, or the stroke had begun before."""
    times_s, forces_n = trial.times_s, without_spikes(trial.forces_n)
    if len(times_s) < 8 or times_s[-1] - times_s[0] < 2.0 * QUIET_S:
        raise StrokeError("hardly any sample was recorded")
    quiet_n = forces_n[times_s < times_s[0] + QUIET_S]
    noise_n = noise_of(quiet_n)
    largest_n = float(np.quantile(np.abs(forces_n - np.median(quiet_n)), 0.995))
    if largest_n < max(CONTACT_NOISES * noise_n, LEAST_FORCE_N):
        raise StrokeError(
            f"no contact: the force stayed within {largest_n:.3f} N of its zero. Was the stage started in time?"
        )
    if noise_n > RESTLESS_FRACTION * largest_n:
        raise StrokeError(f"the force was restless by {noise_n:.3f} N: the stage was moving already, or it shakes")
    begin, level_n = _leaves_zero(times_s, forces_n, max(CONTACT_NOISES * noise_n, CONTACT_FRACTION * largest_n))
    turned = bool(np.median(forces_n[begin : begin + 6]) < level_n)
    sign = -1.0 if turned else 1.0
    return Profile(
        times_s=times_s,
        forces_n=sign * forces_n,
        begin=begin,
        level_n=sign * level_n,
        noise_n=noise_n,
        turned=turned,
        zero_n=sign * trial.zero_n,
    )


def _leaves_zero(times_s: Array, forces_n: Array, bound_n: float) -> tuple[int, float]:
    """Return the first sample in contact, and the zero just before it."""
    for center_s in np.arange(times_s[0] + QUIET_S, times_s[-1], QUIET_S):
        before, here, after = np.searchsorted(times_s, [center_s - QUIET_S, center_s, center_s + QUIET_S])
        if here == before:
            continue
        level_n = float(np.median(forces_n[before:here]))
        away = np.abs(forces_n[here : after + 1] - level_n) > bound_n
        begins = np.flatnonzero(away[:-1] & away[1:])
        if len(begins) and (begins[0] > 0 or center_s > times_s[0] + 1.5 * QUIET_S):
            return int(here + begins[0]), level_n
        if len(begins):
            break
    raise StrokeError("the stage was moving already when the recording began, or only single samples left the zero")


def without_spikes(forces_n: Array) -> Array:
    """Replace single samples far from two neighbours that agree, such as a garbled digit or a knock."""
    if len(forces_n) < 5:
        return forces_n
    before, after = forces_n[:-2], forces_n[2:]
    usual_n = max(float(np.median(np.abs(np.diff(forces_n)))), 1e-6)
    middle_n = (before + after) / 2.0
    apart_n = np.abs(forces_n[1:-1] - middle_n)
    spikes = apart_n > np.maximum(SPIKE_NOISES * usual_n, 3.0 * np.abs(after - before))
    fixed = forces_n.copy()
    fixed[1:-1][spikes] = middle_n[spikes]
    return fixed


def is_off_curve(profile: Profile, residual_n: float, largest_n: float) -> bool:
    """Return whether the residual of a fitted curve is more than noise and the accuracy of any law."""
    return residual_n > max(RESIDUAL_NOISES * profile.noise_n, RESIDUAL_FRACTION * largest_n)


def fit_slope(
    settings: StageSettings, depths_m: Array, forces_n: Array, to_m: float, uncertainty: float
) -> Coefficient:
    """Fit k of F = k V from the surface to `to_m`, with equal weight for equal travel.

    The misfit of the law is no error: k is defined as the least-squares fit to the mud's own curve. `uncertainty` is
    the fraction by which errors of the depth move k.
    """
    middles_m = (depths_m[1:] + depths_m[:-1]) / 2.0
    travels_m = np.abs(np.diff(np.clip(np.concatenate([depths_m[:1], middles_m, depths_m[-1:]]), 0.0, to_m)))
    inside = travels_m > 0.0
    depths_m, forces_n, travels_m = depths_m[inside], forces_n[inside], travels_m[inside]
    volumes_m3 = settings.volumes_m3(depths_m)
    square = float(np.sum(travels_m * volumes_m3 * volumes_m3))
    if len(depths_m) < MIN_BATCHES or not square > 0.0:
        raise StrokeError(
            "fewer than 4 samples in the mud: use a faster amplifier or a slower stage that does not stop"
        )
    value = float(np.sum(travels_m * volumes_m3 * forces_n)) / square
    if value <= 0.0:
        raise StrokeError("the force does not oppose the motion")
    noise_n = noises_n(depths_m, forces_n) * (travels_m * volumes_m3)[1:-1]
    scatter = float(np.sqrt(np.sum(noise_n * noise_n) * len(depths_m) / len(noise_n))) / square
    return Coefficient(value, hypot(student_factor(len(noise_n)) * scatter, uncertainty * value))


def noises_n(depths_m: Array, forces_n: Array) -> Array:
    """Return the noise of all samples but the first and the last.

    Each sample's distance from the line through its neighbours is divided by the scatter of such a distance for
    independent samples (Gasser, Sroka and Jennen-Steinmetz 1986).
    """
    travels_m = np.abs(np.diff(depths_m))
    after = travels_m[:-1] / np.clip(travels_m[:-1] + travels_m[1:], 1e-12, None)
    apart_n = forces_n[1:-1] - (1.0 - after) * forces_n[:-2] - after * forces_n[2:]
    return np.asarray(apart_n / np.sqrt(1.0 + (1.0 - after) ** 2 + after**2))


def steadiness(forces_n: Array) -> tuple[float, str]:
    """Return the standard error of the mean force of a shear, from the means of blocks, and a remark."""
    blocks_n = [float(np.mean(block)) for block in np.array_split(forces_n, BLOCKS)]
    tilt = (blocks_n[-1] - blocks_n[0]) / fmean(blocks_n)
    remark = f"the shear was not steady: it changed by {100.0 * tilt:+.0f} %" if abs(tilt) > UNSTEADY else ""
    return student_factor(BLOCKS - 1) * stdev(blocks_n) / sqrt(BLOCKS), remark
