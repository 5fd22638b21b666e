"""Coefficients of trials whose motion is found from the force on the plate alone.

The start of a stroke is unknown; depth, speed and travel are what the operator set. In the mud the depth grows with the
time since the plate met the surface at t_s,

    z = v (t - t_s)     down to     z = D - a (t_e - t)²/2     while the stage slows down, with z = D from t_e on

and the force is fitted by a level, a rise with depth, perhaps a jump at the surface (mud that resists at once), the
loss of slower mud, (v/v_0)^0.4 as in clay, and the loss at rest. The fit gives t_s, v and a: the speed is measured, and
the set one only starts the search. The residuals decide on the jump.

On the way out the force ends where the plate leaves the mud, and the depth is counted back from there. The force there
is any chain of straight lines over the depth.
"""

from functools import partial
from math import hypot, inf, nan, sqrt

import numpy as np

from experiments.loadcell.curve_fit import Array, CurveFit, cheaper_fit, fit_curve
from experiments.loadcell.strokes import (
    CONTACT_FRACTION,
    CONTACT_NOISES,
    LEAST_FORCE_N,
    RATE_EXPONENT,
    REVERSAL_FRACTION,
    SHIFT,
    YIELD_M,
    AnalysedTrial,
    Coefficient,
    Pace,
    PlateStroke,
    Profile,
    Recorded,
    StageSettings,
    StrokeError,
    fit_slope,
    is_off_curve,
    steadiness,
)

BEFORE_S, AFTER_S = 0.25, 0.2  # of the fit, around the way down
RELAXING_S = 0.2
SLOWING, JUMP = 3, 4  # factors of the fit, after level, rise and rest
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


def analyse_insertion(trial: Recorded, profile: Profile, expected: Pace | None = None) -> AnalysedTrial:
    """Raises StrokeError where the way down does not show the motion.

    Without an `expected` pace the stage may have about the set speed, and ramps from 0.2 to 20 m/s².
    """
    times_s, settings = profile.times_s, trial.settings
    depth_m = settings.depth_m
    fit, samples = _fit_descent(profile, depth_m, expected or Pace(settings.speed_m_s, 2.0, 0.15, 1.2))
    begin_error_s, speed_error, ramp_error = fit.std_errors.tolist()
    pace = _limited_pace(fit.parameters, depth_m)._replace(
        speed_uncertainty=speed_error, acceleration_uncertainty=ramp_error
    )
    surface_s = float(fit.parameters[0] + times_s[profile.begin])
    level_n, rise_n, _, slowing_n, jump_n = fit.factors.tolist()
    strokes = {"k_p": PlateStroke(surface_s, surface_s + pace.descent_s(depth_m), level_n)}
    depths_m, fractions = pace.descend(times_s - surface_s, depth_m)
    opposing_n = profile.forces_n - level_n - slowing_n * _slowing(depths_m, fractions)
    shift = SHIFT * pace.speed_m_s * begin_error_s / depth_m
    k_p = fit_slope(settings, depths_m, opposing_n, depth_m, hypot(shift, pace.speed_uncertainty))
    residual_n, remark, k_e = sqrt(fit.square / samples), "", Coefficient()
    if is_off_curve(profile, residual_n, jump_n + rise_n):
        remark = f"the force is {residual_n:.3f} N off the curve of a stage of one speed: the depth is uncertain"
    try:
        up, out_error_s = find_extraction(profile, strokes["k_p"], pace, depth_m)
        to_m = (1.0 - REVERSAL_FRACTION) * depth_m
        depths_m, _ = pace.descend(up.end_s - times_s, depth_m)
        uncertainty = hypot(SHIFT * pace.speed_m_s * out_error_s / to_m, pace.speed_uncertainty)
        strokes["k_e"] = up
        k_e = fit_slope(settings, depths_m, up.level_n - profile.forces_n, to_m, uncertainty)
    except StrokeError as problem:
        remark = str(problem)
    return AnalysedTrial(
        recorded=trial,
        profile=profile,
        strokes=strokes,
        coefficients={"k_p": k_p, "k_e": k_e},
        remark=remark,
        pace=pace,
        speed_m_s=pace.speed_m_s,
    )


def _fit_descent(profile: Profile, depth_m: float, expected: Pace) -> tuple[CurveFit, int]:
    """Return the fit of the force on the way down, and the number of its samples."""
    times_s, touched_s = profile.times_s, profile.times_s[profile.begin]
    down = (times_s >= touched_s) & (times_s < touched_s + 2.5 * depth_m / expected.speed_m_s)
    top_s = times_s[down][int(np.argmax(profile.forces_n[down]))]
    window = (times_s > touched_s - BEFORE_S) & (times_s < top_s + AFTER_S)
    t, y = times_s[window], profile.forces_n[window]
    if np.count_nonzero((t >= touched_s) & (t <= top_s)) < 6:
        raise StrokeError("fewer than 6 samples on the way down: use a faster amplifier or a slower stage")
    means = np.array([0.0, np.log(expected.speed_m_s), np.log(expected.acceleration_m_s2)])
    prior = means, np.array([np.inf, expected.speed_uncertainty, expected.acceleration_uncertainty])
    shifts = STARTS if expected.speed_uncertainty > NARROW else ((0.0, 0.0),)
    starts = [means + np.array([-0.005, speed, ramp]) for speed, ramp in shifts]

    def fit(jumps: bool, slows: bool) -> CurveFit:
        return fit_curve(partial(_shapes, t - touched_s, depth_m, jumps, slows), y, starts, prior, profile.noise_n)

    kink, jump = (  # the loss of slower mud looks like a longer ramp
        cheaper_fit(fit(jumps, False), fit(jumps, True), SLOWING, -1.0, SLOWING_PRICE, len(y))
        for jumps in (False, True)
    )
    return cheaper_fit(kink, jump, JUMP, 1.0, JUMP_PRICE, len(y)), len(y)


def _limited_pace(parameters: Array, depth_m: float) -> Pace:
    """Return a pace with a ramp no longer than the stroke."""
    speed_m_s = float(np.exp(np.clip(parameters[1], -9.0, 3.0)))
    ramp_m_s2 = float(np.exp(np.clip(parameters[2], -5.0, 6.0)))
    return Pace(speed_m_s, max(ramp_m_s2, 0.55 * speed_m_s * speed_m_s / depth_m))


def _slowing(depths_m: Array, fractions: Array) -> Array:
    """Return the part of the force that mud loses at a fraction of the full speed."""
    return np.asarray(np.clip(depths_m / YIELD_M, 0.0, 1.0) * (1.0 - fractions**RATE_EXPONENT))


def _shapes(t: Array, depth_m: float, jumps: bool, slows: bool, parameters: Array) -> Array:
    pace, since_s = _limited_pace(parameters, depth_m), t - parameters[0]
    depths_m, fractions = pace.descend(since_s, depth_m)
    rest = 1.0 - np.exp(-np.clip(since_s - pace.descent_s(depth_m), 0.0, None) / RELAXING_S)
    return np.stack(  # a column of zeros gets the factor 0
        [
            np.ones_like(t),
            np.clip(depths_m, 0.0, None) / depth_m,
            rest,
            slows * _slowing(depths_m, fractions),
            jumps * np.clip(depths_m / YIELD_M, 0.0, 1.0),
        ],
        1,
    )


def find_extraction(profile: Profile, insertion: PlateStroke, pace: Pace, depth_m: float) -> tuple[PlateStroke, float]:
    """Return the way up, and the standard error of the moment at which the plate is out.

    Raises StrokeError where the plate was not drawn out.
    """
    times_s, forces_n = profile.times_s, profile.forces_n - insertion.level_n
    after = times_s > insertion.end_s + 0.2
    least_n = float(np.min(forces_n[after], initial=0.0))
    threshold_n = max(CONTACT_NOISES * profile.noise_n, CONTACT_FRACTION * -least_n)
    if -least_n < max(threshold_n, LEAST_FORCE_N):
        raise StrokeError("no extraction: the force never pulled downward. Was the plate drawn out in time?")
    lowest = int(np.flatnonzero(after & (forces_n == least_n))[0])
    pulled = np.flatnonzero(forces_n[lowest:] < -threshold_n)
    last_s = float(times_s[lowest + int(pulled[-1])])
    if times_s[-1] < last_s + 0.1:
        raise StrokeError("the recording ended before the plate was out of the mud")
    unseen_m = depth_m * OUT_MARGIN * threshold_n / -least_n  # below the noise, for a force linear in depth
    period_s = float(np.median(np.diff(times_s)))
    reach_s = (unseen_m / pace.speed_m_s + OUT_MARGIN * period_s) / 2.0
    out_s = last_s + 0.95 * reach_s
    for _ in range(OUT_ROUNDS):
        tried_s = out_s + reach_s * np.linspace(-1.0, 1.0, OUT_PLACES)
        fits = [_fit_out(float(each) - times_s, forces_n, pace, depth_m) for each in tried_s]
        squares = [inf, *(square for square, *_ in fits), inf]
        best = next(  # the first valley: a chain that begins later, with a flat piece, fits as well
            i
            for i, (before, square, after) in enumerate(zip(squares, squares[1:], squares[2:], strict=False))
            if square <= min(before, after, VALLEY * min(squares))
        )
        out_s, reach_s = float(tried_s[best]), 2.0 * reach_s / (OUT_PLACES - 1)
    _, level_n, out_error_s = fits[best]
    return PlateStroke(out_s - pace.descent_s(depth_m), out_s, insertion.level_n + level_n), out_error_s


def _fit_out(left_s: Array, forces_n: Array, pace: Pace, depth_m: float) -> tuple[float, float, float]:
    """Fit a chain of lines that ends at the surface.

    Return its mean squared residual, the level after it, and the standard error of the moment at the surface.
    """
    depths_m, sooner_m = (pace.descend(each_s, depth_m)[0] for each_s in (left_s, left_s + DIFFERENCE_S))
    window = (depths_m <= (1.0 - REVERSAL_FRACTION) * depth_m) & (left_s > -AFTER_OUT_S)
    y, columns = forces_n[window], _chain(depths_m[window], depth_m)
    factors = np.linalg.lstsq(columns, y, rcond=None)[0]
    square = float(np.mean((columns @ factors - y) ** 2))
    later = (_chain(sooner_m[window], depth_m) - columns) @ factors / DIFFERENCE_S
    slopes = np.column_stack([later, columns])
    variance = square * len(y) / max(len(y) - slopes.shape[1], 1)
    return square, float(factors[0]), float(np.sqrt(variance * np.linalg.pinv(slopes.T @ slopes)[0, 0]))


def _chain(depths_m: Array, depth_m: float) -> Array:
    """Return columns for a level and for one line after the other."""
    lines = [np.interp(depths_m, depth_m * KNOTS, unit) for unit in np.eye(len(KNOTS))[1:]]
    return np.stack([np.ones_like(depths_m), *lines], 1)


def depths_of(trial: AnalysedTrial) -> Array:
    """Return the depth of each sample of an insertion, measured or found from the force."""
    if trial.positions_m is not None:
        return trial.positions_m
    assert trial.pace is not None
    times_s, pace, depth_m = trial.profile.times_s, trial.pace, trial.recorded.settings.depth_m
    down_m, _ = pace.descend(times_s - trial.strokes["k_p"].begin_s, depth_m)
    if "k_e" not in trial.strokes:
        return down_m
    return np.minimum(down_m, pace.descend(trial.strokes["k_e"].end_s - times_s, depth_m)[0])


def analyse_shear(trial: Recorded, profile: Profile) -> AnalysedTrial:
    """Evaluate the second half of the travel, shorter where the stage stopped early. Raises StrokeError."""
    forces_n, moment_m3 = profile.forces_n - profile.zero_n, trial.settings.moment_m3
    stroke, speed_m_s = _find_shear(profile, forces_n, trial.settings)
    steady_n = forces_n[(profile.times_s >= stroke.steady_s) & (profile.times_s <= stroke.end_s)]
    error_n, remark = steadiness(steady_n)
    return AnalysedTrial(
        recorded=trial,
        profile=profile,
        strokes={"k_s": stroke},
        coefficients={"k_s": Coefficient(float(np.mean(steady_n)) / moment_m3, error_n / moment_m3)},
        remark=remark,
        speed_m_s=speed_m_s,
    )


def _find_shear(profile: Profile, forces_n: Array, settings: StageSettings) -> tuple[PlateStroke, float]:
    """Return the stroke and its speed, NaN where the force does not show the stop."""
    times_s = profile.times_s
    begin_s = float(times_s[profile.begin])
    stroke_s = settings.shear_path_m / settings.speed_m_s
    half = (times_s > begin_s + 0.35 * stroke_s) & (times_s < begin_s + 0.5 * stroke_s)
    if times_s[-1] < begin_s + 0.5 * stroke_s:
        raise StrokeError("the recording ended before the force was steady")
    if np.count_nonzero(half) < 2:
        raise StrokeError("hardly any sample in the shear: use a faster amplifier or a slower stage")
    plateau_n = float(np.median(forces_n[half]))
    is_low = forces_n < FALLEN_FRACTION * plateau_n
    stop_s = next(
        (
            float(time_s)
            for time_s in times_s[is_low & (times_s > begin_s + 0.5 * stroke_s)]
            if np.all(is_low[(times_s >= time_s) & (times_s < time_s + LOW_S)])
        ),
        nan,
    )
    to_s = float(np.nanmin([begin_s + 0.96 * stroke_s, stop_s - 0.03]))
    from_s = min(begin_s + 0.5 * stroke_s, (begin_s + to_s) / 2.0)
    if np.count_nonzero((times_s >= from_s) & (times_s <= to_s)) < 8 or plateau_n < LEAST_FORCE_N:
        raise StrokeError(
            "no steady shear: the force fell before half of the travel. Start the stage after the recording starts"
        )
    return PlateStroke(begin_s, to_s, steady_s=from_s), settings.shear_path_m / (stop_s - begin_s)
