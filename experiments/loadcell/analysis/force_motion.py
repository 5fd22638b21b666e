"""The motion of the stage, found from the force on its plate alone.

The start of a stroke is unknown; depth, speed and travel are what the operator set. In the mud the depth grows with the
time since the plate met the surface at t_s,

    z = v (t - t_s)     down to     z = D - a (t_e - t)²/2     while the stage slows down, with z = D from t_e on

and the force is fitted by a level, a rise with depth, perhaps a jump at the surface (mud that resists at once), the
loss of slower mud, (v/v_0)^0.4 as in clay, and the loss at rest. The fit gives t_s, v and a: the speed is measured, and
the set one only starts the search. The residuals decide on the jump.

On the way out the force ends where the plate leaves the mud, and the depth is counted back from there. The force there
is any chain of straight lines over the depth.
"""

from dataclasses import dataclass, field
from functools import partial
from math import nan
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.bounds import Bounds
from control.geometry import FlipperGeometry
from experiments.loadcell.analysis.contact import CONTACT_FRACTION, CONTACT_NOISES, LEAST_FORCE_N, Profile, StrokeError
from experiments.loadcell.analysis.curve_fit import Array, CurveFit, Prior, cheaper_fit, fit_curve

BEFORE_S, AFTER_S = 0.25, 0.2  # of the fit, around the way down
YIELD_M = 0.001  # over which a jump grows
RATE_EXPONENT = 0.4
RELAXING_S = 0.2
LEVEL, RISE, _, SLOWING, JUMP = range(5)  # factors of the fit
JUMP_PRICE, SLOWING_PRICE = 4.0, 1.0  # least improvement of the fit
STARTS = tuple(
    (speed, ramp) for speed in (-0.15, 0.0, 0.15) for ramp in (-1.0, 0.7)
)  # logarithms, relative to the prior
NARROW = 0.05  # uncertainty of a speed below which one start is enough
AFTER_OUT_S = 0.3
OUT_MARGIN = 1.5  # how much later the end may lie than the last sample that clearly pulls
DIFFERENCE_S = 1e-4
OUT_ROUNDS, OUT_PLACES = 3, 13  # of a search that gets finer
VALLEY = 2.0  # by which the first minimum may exceed the least
KNOTS = np.array([0.0, 1 / 6, 1 / 3, 1 / 2, 3 / 4])  # of the chain, in depths
FALLEN_FRACTION, LOW_S = 0.93, 0.2  # of a steady shear: the stage has stopped
REVERSAL_FRACTION = 0.25  # of the way up, as in the estimator


@dataclass(frozen=True)
class StageSettings:
    """The motion that the operator set, and the plate."""

    depth_m: Annotated[float, Bounds(0.005, 0.2)] = 0.03
    speed_m_s: Annotated[float, Bounds(0.001, 1.0)] = 0.1
    hold_s: Annotated[float, Bounds(0.5, 60.0)] = 3.0
    shear_path_m: Annotated[float, Bounds(0.05, 2.0)] = field(default=0.2, metadata={"key": "shear_way_m"})
    plate_width_m: Annotated[float, Bounds(0.002, 0.5)] = 0.03
    plate_height_m: Annotated[float, Bounds(0.002, 0.5)] = 0.035
    plate_thickness_m: Annotated[float, Bounds(0.0002, 0.1)] = 0.004

    @property
    def plate(self) -> FlipperGeometry:
        """The plate; nothing else of this geometry is used."""
        return FlipperGeometry(
            plate_width_m=self.plate_width_m,
            plate_height_m=self.plate_height_m,
            plate_thickness_m=self.plate_thickness_m,
        )


class Pace(NamedTuple):
    """Speed and ramp of a stage, with relative uncertainties."""

    speed_m_s: float
    acceleration_m_s2: float = nan  # a hand has no ramp
    speed_uncertainty: float = nan
    acceleration_uncertainty: float = nan


class Insertion(NamedTuple):
    """A stroke; its parts of the force are NaN where an encoder measured the motion."""

    surface_s: float
    surface_std_error_s: float
    stop_s: float
    pace: Pace
    level_n: float
    residual_n: float
    jump_n: float = nan
    rise_n: float = nan  # from surface to full depth, without the jump
    slowing_n: float = nan  # by which the force changes as the stage stops, 0 or less


class Extraction(NamedTuple):
    lift_s: float
    out_s: float
    level_n: float
    out_std_error_s: float = nan


class Shear(NamedTuple):
    begin_s: float
    steady_from_s: float
    steady_to_s: float
    speed_m_s: float  # NaN where the force does not show the stop


def wide_pace(settings: StageSettings) -> Pace:
    """Return the prior before any measurement: about the set speed, with ramps from 0.2 to 20 m/s²."""
    return Pace(settings.speed_m_s, 2.0, 0.15, 1.2)


def find_insertion(profile: Profile, settings: StageSettings, expected: Pace) -> Insertion:
    """Raises StrokeError where there are too few samples."""
    times_s, depth_m = profile.times_s, settings.depth_m
    touched_s = times_s[profile.begin]
    down = (times_s >= touched_s) & (times_s < touched_s + 2.5 * depth_m / expected.speed_m_s)
    top_s = times_s[down][int(np.argmax(profile.forces_n[down]))]
    window = (times_s > touched_s - BEFORE_S) & (times_s < top_s + AFTER_S)
    t, y = times_s[window], profile.forces_n[window]
    if np.count_nonzero((t >= touched_s) & (t <= top_s)) < 6:
        raise StrokeError("fewer than 6 samples on the way down: use a faster amplifier or a slower stage")
    prior = Prior(
        np.array([0.0, np.log(expected.speed_m_s), np.log(expected.acceleration_m_s2)]),
        np.array([np.inf, expected.speed_uncertainty, expected.acceleration_uncertainty]),
    )
    shifts = STARTS if expected.speed_uncertainty > NARROW else ((0.0, 0.0),)
    starts = [prior.means + np.array([-0.005, speed, ramp]) for speed, ramp in shifts]

    def fit(jumps: bool, slows: bool) -> CurveFit:
        return fit_curve(partial(_shapes, t - touched_s, depth_m, jumps, slows), y, starts, prior, profile.noise_n)

    kink, jump = (  # the loss of slower mud looks like a longer ramp
        cheaper_fit(fit(jumps, False), fit(jumps, True), SLOWING, -1.0, SLOWING_PRICE, len(y))
        for jumps in (False, True)
    )
    return _insertion(cheaper_fit(kink, jump, JUMP, 1.0, JUMP_PRICE, len(y)), touched_s, depth_m, len(y))


def _pace_of(parameters: Array, depth_m: float) -> tuple[float, float]:
    """Return speed and acceleration, with a ramp no longer than the stroke."""
    speed_m_s = float(np.exp(np.clip(parameters[1], -9.0, 3.0)))
    ramp_m_s2 = float(np.exp(np.clip(parameters[2], -5.0, 6.0)))
    return speed_m_s, max(ramp_m_s2, 0.55 * speed_m_s * speed_m_s / depth_m)


def _shapes(t: Array, depth_m: float, jumps: bool, slows: bool, parameters: Array) -> Array:
    speed_m_s, acceleration_m_s2 = _pace_of(parameters, depth_m)
    depths_m, fractions = descent(t - parameters[0], speed_m_s, acceleration_m_s2, depth_m)
    wet = np.clip(depths_m / YIELD_M, 0.0, 1.0)
    rested_s = np.clip(t - parameters[0] - descent_s(speed_m_s, acceleration_m_s2, depth_m), 0.0, None)
    rest = 1.0 - np.exp(-rested_s / RELAXING_S)
    slowing = wet * (1.0 - fractions**RATE_EXPONENT)
    return np.stack(  # a column of zeros gets the factor 0
        [np.ones_like(t), np.clip(depths_m, 0.0, None) / depth_m, rest, slows * slowing, jumps * wet], 1
    )


def descent_s(speed_m_s: float, acceleration_m_s2: float, depth_m: float) -> float:
    """Return the time from the surface to the stop."""
    return depth_m / speed_m_s + speed_m_s / (2.0 * acceleration_m_s2)


def descent(since_s: Array, speed_m_s: float, acceleration_m_s2: float, depth_m: float) -> tuple[Array, Array]:
    """Return the depth, and the fraction of the full speed, by the time since the surface."""
    left_s = np.clip(descent_s(speed_m_s, acceleration_m_s2, depth_m) - since_s, 0.0, None)
    slowing = left_s < speed_m_s / acceleration_m_s2
    slow_m = depth_m - acceleration_m_s2 * left_s * left_s / 2.0
    return (
        np.where(slowing, slow_m, speed_m_s * since_s),
        np.where(slowing, acceleration_m_s2 * left_s / speed_m_s, 1.0),
    )


def _insertion(fit: CurveFit, touched_s: float, depth_m: float, samples: int) -> Insertion:
    speed_m_s, acceleration_m_s2 = _pace_of(fit.parameters, depth_m)
    surface_s = float(fit.parameters[0] + touched_s)
    return Insertion(
        surface_s=surface_s,
        surface_std_error_s=float(fit.std_errors[0]),
        stop_s=surface_s + descent_s(speed_m_s, acceleration_m_s2, depth_m),
        pace=Pace(speed_m_s, acceleration_m_s2, float(fit.std_errors[1]), float(fit.std_errors[2])),
        level_n=float(fit.factors[LEVEL]),
        jump_n=float(fit.factors[JUMP]),
        rise_n=float(fit.factors[RISE]),
        slowing_n=float(fit.factors[SLOWING]),
        residual_n=float(np.sqrt(fit.square / samples)),
    )


def find_extraction(profile: Profile, insertion: Insertion, settings: StageSettings) -> Extraction:
    """Raises StrokeError where the plate was not drawn out."""
    times_s, forces_n = profile.times_s, profile.forces_n - insertion.level_n
    after = times_s > insertion.stop_s + 0.2
    least_n = float(np.min(forces_n[after], initial=0.0))
    threshold_n = max(CONTACT_NOISES * profile.noise_n, CONTACT_FRACTION * -least_n)
    if -least_n < max(threshold_n, LEAST_FORCE_N):
        raise StrokeError("no extraction: the force never pulled downward. Was the plate drawn out in time?")
    lowest = int(np.flatnonzero(after & (forces_n == least_n))[0])
    pulled = np.flatnonzero(forces_n[lowest:] < -threshold_n)
    last_s = float(times_s[lowest + int(pulled[-1])])
    if times_s[-1] < last_s + 0.1:
        raise StrokeError("the recording ended before the plate was out of the mud")
    pace, depth_m = insertion.pace, settings.depth_m
    unseen_m = depth_m * OUT_MARGIN * threshold_n / -least_n  # below the noise, for a force linear in depth
    period_s = float(np.median(np.diff(times_s)))
    reach_s, level_n = (unseen_m / pace.speed_m_s + OUT_MARGIN * period_s) / 2.0, 0.0
    out_s = last_s + 0.95 * reach_s
    for _ in range(OUT_ROUNDS):
        tried_s = out_s + reach_s * np.linspace(-1.0, 1.0, OUT_PLACES)
        fits = [_fit_out(float(each) - times_s, forces_n, pace, depth_m) for each in tried_s]
        best = _first_valley([fit.square for fit in fits])
        out_s, level_n, reach_s = float(tried_s[best]), fits[best].level_n, 2.0 * reach_s / (OUT_PLACES - 1)
    lift_s = out_s - descent_s(pace.speed_m_s, pace.acceleration_m_s2, depth_m)
    return Extraction(lift_s, out_s, insertion.level_n + level_n, fits[best].std_error_s)


def _first_valley(squares: list[float]) -> int:
    """Return the first minimum: a chain that begins later, with a flat piece, fits as well."""
    padded = [float("inf"), *squares, float("inf")]
    valleys = [i for i, square in enumerate(squares) if padded[i] >= square <= padded[i + 2]]
    return next(i for i in valleys if squares[i] <= VALLEY * min(squares))


class _OutFit(NamedTuple):
    square: float  # mean squared residual of a chain of lines that ends at the surface
    level_n: float  # after it
    std_error_s: float  # of that moment


def _fit_out(left_s: Array, forces_n: Array, pace: Pace, depth_m: float) -> _OutFit:
    depths_m, sooner_m = (
        descent(each_s, pace.speed_m_s, pace.acceleration_m_s2, depth_m)[0]
        for each_s in (left_s, left_s + DIFFERENCE_S)
    )
    window = (depths_m <= (1.0 - REVERSAL_FRACTION) * depth_m) & (left_s > -AFTER_OUT_S)
    y, columns = forces_n[window], _chain(depths_m[window], depth_m)
    factors = np.linalg.lstsq(columns, y, rcond=None)[0]
    square = float(np.mean((columns @ factors - y) ** 2))
    later = (_chain(sooner_m[window], depth_m) - columns) @ factors / DIFFERENCE_S
    slopes = np.column_stack([later, columns])
    variance = square * len(y) / max(len(y) - slopes.shape[1], 1)
    return _OutFit(square, float(factors[0]), float(np.sqrt(variance * np.linalg.pinv(slopes.T @ slopes)[0, 0])))


def _chain(depths_m: Array, depth_m: float) -> Array:
    """Return columns for a level and for one line after the other."""
    lines = [np.interp(depths_m, depth_m * KNOTS, unit) for unit in np.eye(len(KNOTS))[1:]]
    return np.stack([np.ones_like(depths_m), *lines], 1)


def find_shear(profile: Profile, settings: StageSettings, zero_n: float) -> Shear:
    """Find the second half of the travel, shorter where the stage stopped early. Raises StrokeError."""
    times_s, forces_n = profile.times_s, profile.forces_n - zero_n
    begin_s = float(times_s[profile.begin])
    stroke_s = settings.shear_path_m / settings.speed_m_s
    half = (times_s > begin_s + 0.35 * stroke_s) & (times_s < begin_s + 0.5 * stroke_s)
    if times_s[-1] < begin_s + 0.5 * stroke_s:
        raise StrokeError("the recording ended before the force was steady")
    if np.count_nonzero(half) < 2:
        raise StrokeError("hardly any sample in the shear: use a faster amplifier or a slower stage")
    plateau_n = float(np.median(forces_n[half]))
    stop_s = _falls_s(times_s, forces_n < FALLEN_FRACTION * plateau_n, begin_s + 0.5 * stroke_s)
    to_s = float(np.nanmin([begin_s + 0.96 * stroke_s, stop_s - 0.03]))
    from_s = min(begin_s + 0.5 * stroke_s, (begin_s + to_s) / 2.0)
    if np.count_nonzero((times_s >= from_s) & (times_s <= to_s)) < 8 or plateau_n < LEAST_FORCE_N:
        raise StrokeError(
            "no steady shear: the force fell before half of the travel. Start the stage after the recording starts"
        )
    return Shear(begin_s, from_s, to_s, settings.shear_path_m / (stop_s - begin_s))


def _falls_s(times_s: Array, is_low: NDArray[np.bool_], from_s: float) -> float:
    """Return the time at which the force falls and stays low, or NaN."""
    for i in np.flatnonzero(is_low & (times_s > from_s)):
        if np.all(is_low[(times_s >= times_s[i]) & (times_s < times_s[i] + LOW_S)]):
            return float(times_s[i])
    return nan
