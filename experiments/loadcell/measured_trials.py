"""Coefficients of trials on a stage with an encoder.

A stage that is pushed by hand moves at any speed and rests on its way. Its position is measured (stage_track.py), and
depths count from the surface that the force shows; only a shear keeps the set depth. Forces are corrected to the set
speed. The surface z_0 and the lag of the forces come out of one fit of the force to the depth
z = position(t - lag) - z_0, down and up together:

    down    F = level + (rise z + perhaps a jump at the surface) g       up    F = level + (a chain of lines in z) g

with the speed factor g (stage_track.py). A wrong lag moves fast parts of the stroke farther than slow ones, and the way
down against the way up, which makes it observable. Where the stage rests the mud relaxes, so samples at rest, and over
the next millimetres, do not count.
"""

from functools import partial
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.loadcell.curve_fit import Array, CurveFit, cheaper_fit, fit_curve
from experiments.loadcell.force_trials import JUMP_PRICE, KNOTS
from experiments.loadcell.stage_track import RESTING_FRACTION, PositionedProfile, fit_rate
from experiments.loadcell.strokes import (
    LEAST_FORCE_N,
    REVERSAL_FRACTION,
    SHEAR,
    SHIFT,
    YIELD_M,
    Alignment,
    AnalysedTrial,
    Coefficient,
    Mask,
    PlateStroke,
    Profile,
    Recorded,
    StageSettings,
    StrokeError,
    fit_slope,
    is_off_curve,
    steadiness,
)

LEAST_POSITIONS = 8
WAKING_M = 0.002  # of travel after a rest, until mud resists as before
WAKING_SIDEWAYS_M = 0.005  # the same for a shear
AIR_M = 0.012  # above the contact, for the level
BOTTOM_M = 3e-4  # from the deepest position
LEAST_SAMPLES = 6  # in the mud
LEAST_AIR = 4
LEAST_FRACTION = 0.3  # of the set depth, which the encoder must see
ROUNDS = 3  # of selecting samples by the lag and fitting the lag to them
LAG_STARTS_S = (-0.02, 0.0, 0.02)
NARROW_S = 0.01
TURNING_S, LARGEST_LAG_S = 0.01, 0.3
PARTS = 4  # of a conversion, in which the plate may meet the surface
LAW_FRACTION = 0.015  # of the largest force: the accuracy of any law
DEPTH_BOUND = 0.1  # difference from the set depth that is remarked
EVEN_DEPTHS = 60
LAST_FRACTION = 0.3
WRONG_AXIS = "is the encoder on the axis that moves, and is --position-step its travel per count?"
NO_EXTRACTION = "no extraction: the encoder did not see the plate come up. Was it lifted out in time?"


def analyse_measured(trial: Recorded, profile: Profile, expected: Alignment) -> AnalysedTrial:
    """Raises StrokeError where the positions do not show the stroke."""
    if trial.positions is None or len(trial.positions.times_s) < LEAST_POSITIONS:
        raise StrokeError("the encoder measured hardly any position")
    stroke = PositionedProfile(profile, trial.positions, trial.settings)
    return (_analyse_shear if trial.kind == SHEAR else _analyse_insertion)(trial, stroke, expected)


# insertions


class _Window(NamedTuple):
    """The samples of the fit, and the positions at the surface (roughly) and at the bottom."""

    down: Mask
    up: Mask
    surface_m: float
    deepest_m: float
    has_air: bool  # after the way up, for its own level: clinging mud has weight


class _Depths(NamedTuple):
    """The depths of the samples, NaN where the position is unknown, and what a speed does to their forces."""

    depths_m: Array
    speed_factors: Array  # g
    rate_errors: Array  # relative, of the forces

    @property
    def deepest_m(self) -> float:
        return float(np.nanmax(self.depths_m))

    def order(self, chosen: Mask) -> NDArray[np.intp]:
        """Return the indices of the chosen samples by depth."""
        return np.flatnonzero(chosen)[np.argsort(self.depths_m[chosen], kind="stable")]

    def rate_uncertainty(self, chosen: Mask) -> float:
        """Return the relative uncertainty of k from those of the force at each sample's speed."""
        order = self.order(chosen)
        depths_m = self.depths_m[order]
        weights = depths_m * np.clip(np.gradient(depths_m), 1e-9, None)
        return abs(float(np.average(self.rate_errors[order], weights=weights)))


def _analyse_insertion(trial: Recorded, stroke: PositionedProfile, expected: Alignment) -> AnalysedTrial:
    profile, times_s = stroke.profile, stroke.profile.times_s
    window, fit = _fit_stroke(stroke, expected)
    surface_m, lag_s, rate_fraction = fit.parameters.tolist()
    surface_error_m, lag_error_s, rate_error = fit.std_errors.tolist()
    depths = _Depths(
        stroke.mean_positions_m(lag_s) - surface_m,
        stroke.speed_factors(lag_s, rate_fraction),
        expected.rate_uncertainty * stroke.speed_terms(lag_s),
    )
    wet, bottom = (np.flatnonzero(depths.depths_m > above_m) for above_m in (0.0, depths.deepest_m - BOTTOM_M))
    down, up = (way & (depths.depths_m > 0.0) for way in (window.down, window.up))
    speed_m_s = _mean_speed_m_s(stroke.speeds_m_s(lag_s)[down])
    level_n, up_level_n = float(fit.factors[0]), float(fit.factors[-1 if window.has_air else 0])
    strokes = {"k_p": PlateStroke(float(times_s[wet[0]]), float(times_s[bottom[0]]), level_n)}
    depth_error_m = hypot(surface_error_m, stroke.interpolation_error_m)
    opposing_n = profile.forces_n - level_n
    k_p = _fit_slope(depths, stroke.settings, opposing_n, down, depths.deepest_m, depth_error_m)
    residual_n = sqrt(fit.square / np.count_nonzero(window.down | window.up))
    remark = _remark(stroke, depths.deepest_m, residual_n, float(np.max(np.abs(opposing_n[down]))))
    k_e = Coefficient()
    if np.count_nonzero(up) >= LEAST_SAMPLES:
        strokes["k_e"] = PlateStroke(float(times_s[bottom[-1]]), float(times_s[wet[-1]]), up_level_n)
        depth_error_m = hypot(depth_error_m, speed_m_s * lag_error_s)
        to_m = (1.0 - REVERSAL_FRACTION) * depths.deepest_m
        k_e = _fit_slope(depths, stroke.settings, up_level_n - profile.forces_n, up, to_m, depth_error_m)
    return AnalysedTrial(
        recorded=trial,
        profile=profile,
        strokes=strokes,
        coefficients={"k_p": k_p, "k_e": k_e},
        remark=remark if "k_e" in strokes else NO_EXTRACTION,
        speed_m_s=speed_m_s,
        shared_uncertainty=depths.rate_uncertainty(down | up),
        positions_m=depths.depths_m,
        position_error_m=depth_error_m,
        alignment=Alignment(lag_s, rate_fraction, lag_error_s, rate_error),
    )


def _fit_stroke(stroke: PositionedProfile, expected: Alignment) -> tuple[_Window, CurveFit]:
    """Select samples by the lag and fit the lag to them, in turn. Raises StrokeError."""
    wide = expected.lag_uncertainty_s > NARROW_S
    lag_s = _rough_lag_s(stroke) if wide else expected.lag_s
    for round_ in range(ROUNDS if wide else 1):
        window = _window(stroke, lag_s)
        shifts_s = LAG_STARTS_S if wide and round_ == 0 else (0.0,)
        starts = [np.array([window.surface_m - YIELD_M, lag_s + shift, expected.rate_fraction]) for shift in shifts_s]
        fit = _best_fit(stroke, expected, window, starts)
        lag_s = float(fit.parameters[1])
    return window, fit


def _rough_lag_s(stroke: PositionedProfile) -> float:
    """Estimate the lag from the reversal of the force after the stage leaves the bottom; 0 without a reversal."""
    times_s, forces_n = stroke.profile.times_s, stroke.profile.forces_n - stroke.profile.level_n
    positions_m, lowest = stroke.positions_m(times_s), int(np.argmin(forces_n))
    at_bottom = np.flatnonzero(positions_m > np.max(positions_m) - BOTTOM_M)
    pushed = np.flatnonzero(forces_n[:lowest] > 0.0)
    if forces_n[lowest] > -LEAST_FORCE_N or not len(pushed):
        return 0.0
    lag_s = float(times_s[pushed[-1]] - times_s[at_bottom[-1]]) - TURNING_S
    return lag_s if abs(lag_s) < LARGEST_LAG_S else 0.0


def _window(stroke: PositionedProfile, lag_s: float) -> _Window:
    positions_m, speeds_m_s = stroke.mean_positions_m(lag_s), stroke.speeds_m_s(lag_s)
    known, order = np.isfinite(positions_m), np.arange(len(positions_m))
    touched_s = stroke.profile.times_s[stroke.profile.begin]
    surface_m = float(stroke.positions_m(np.array([touched_s - lag_s]))[0])
    deepest_m = float(np.max(positions_m[known], initial=surface_m))
    path_m = deepest_m - surface_m
    if path_m < LEAST_FRACTION * stroke.settings.depth_m:
        raise StrokeError(f"the encoder saw {1000.0 * path_m:.1f} mm of the travel into the mud: {WRONG_AXIS}")
    at_bottom = order[known][positions_m[known] > deepest_m - BOTTOM_M]
    above = known & (positions_m > surface_m - AIR_M)
    bearing = positions_m < surface_m + (1.0 - REVERSAL_FRACTION) * path_m
    resting_m_s = RESTING_FRACTION * stroke.settings.speed_m_s
    down, up = above & (order < at_bottom[0]), known & (order > at_bottom[-1])
    mud = positions_m > surface_m - YIELD_M  # air does not relax
    down[down] = moving(positions_m[down], speeds_m_s[down], resting_m_s, WAKING_M, mud[down])
    up[up] = moving(-positions_m[up], -speeds_m_s[up], resting_m_s, WAKING_M, mud[up])
    up &= bearing & above
    if np.count_nonzero(down & (positions_m > surface_m)) < LEAST_SAMPLES:
        raise StrokeError(f"fewer than {LEAST_SAMPLES} samples with force and position on the way down")
    has_air = bool(np.count_nonzero(up & (positions_m < surface_m - YIELD_M)) >= LEAST_AIR)
    return _Window(down=down, up=up, surface_m=surface_m, deepest_m=deepest_m, has_air=has_air)


def moving(
    positions_m: Array, speeds_m_s: Array, resting_m_s: float, waking_m: float, in_mud: Mask | bool = True
) -> Mask:
    """Select samples in which the stage moves forward, and has done so for `waking_m` since it last rested in mud."""
    moves = speeds_m_s > resting_m_s
    moves &= np.append(moves[1:], False)
    rested_m = np.where(moves | ~np.asarray(in_mud), -np.inf, positions_m)
    return np.asarray(moves & (positions_m - np.maximum.accumulate(rested_m) > waking_m))


def _best_fit(stroke: PositionedProfile, expected: Alignment, window: _Window, starts: list[Array]) -> CurveFit:
    """Include a jump at the surface only where it pays."""
    y = stroke.profile.forces_n[window.down | window.up]
    noise_n = max(stroke.profile.noise_n, LAW_FRACTION * float(np.max(np.abs(y - stroke.profile.level_n))))
    means = np.array([0.0, expected.lag_s, expected.rate_fraction])
    prior = means, np.array([np.inf, expected.lag_uncertainty_s, expected.rate_uncertainty])
    kink, jump = (
        fit_curve(partial(_shapes, stroke, window, jumps), y, starts, prior, noise_n) for jumps in (False, True)
    )
    return cheaper_fit(kink, jump, 2, 1.0, JUMP_PRICE, len(y))


def _shapes(stroke: PositionedProfile, window: _Window, jumps: bool, parameters: Array) -> Array:
    """Return columns: level, rise and jump of the way down, then the chain and the level of the way up.

    Columns that are not linear in depth are averaged over the parts of a conversion.
    """
    surface_m, lag_s, rate_fraction = parameters.tolist()
    chosen = window.down | window.up
    down, knots_m = window.down[chosen], KNOTS * (window.deepest_m - surface_m)
    until_s, part_s = stroke.profile.times_s[chosen] - lag_s, stroke.period_s / PARTS
    columns = np.zeros((len(until_s), 2 + len(KNOTS)))
    for part in range(PARTS):
        wet_m = np.clip(stroke.positions_m(until_s - (part + 0.5) * part_s) - surface_m, 0.0, None)
        columns[:, 0] += wet_m / stroke.settings.depth_m
        columns[:, 1] += jumps * np.clip(wet_m / YIELD_M, 0.0, 1.0)
        for knot, unit in enumerate(np.eye(len(KNOTS))[1:]):
            columns[:, 2 + knot] += np.interp(wet_m, knots_m, unit)
    columns *= stroke.speed_factors(lag_s, rate_fraction)[chosen, None] / PARTS
    columns[~down, :2] = columns[down, 2:] = 0.0
    columns[:, -1] = ~down & window.has_air
    return np.column_stack([down | (not window.has_air), columns]).astype(np.float64)


def _fit_slope(
    depths: _Depths, settings: StageSettings, forces_n: Array, chosen: Mask, to_m: float, depth_error_m: float
) -> Coefficient:
    """Fit k from the surface to `to_m`, with equal weight for equal travel wherever the stage rested."""
    order = depths.order(chosen)
    depths_m, corrected_n = depths.depths_m[order], forces_n[order] / depths.speed_factors[order]
    uncertainty = hypot(SHIFT * depth_error_m / to_m, depths.rate_uncertainty(chosen))
    error = fit_slope(settings, depths_m, corrected_n, to_m, uncertainty).std_error
    even_m = to_m * (np.arange(EVEN_DEPTHS) + 0.5) / EVEN_DEPTHS
    even_n = np.interp(even_m, np.append(0.0, depths_m), np.append(0.0, corrected_n))
    last = depths_m > depths_m[-1] - LAST_FRACTION * to_m
    if np.count_nonzero(last) > 2:  # down to where the stage stopped, by the line of the last piece
        line = np.polyfit(depths_m[last], corrected_n[last], 1)
        even_n = np.where(even_m > depths_m[-1], np.polyval(line, even_m), even_n)
    volumes_m3 = settings.volumes_m3(even_m)
    return Coefficient(float(volumes_m3 @ even_n / (volumes_m3 @ volumes_m3)), error)


def _remark(stroke: PositionedProfile, deepest_m: float, residual_n: float, largest_n: float) -> str:
    set_m = stroke.settings.depth_m
    if abs(deepest_m / set_m - 1.0) > DEPTH_BOUND:
        return (
            f"the plate went {100.0 * deepest_m:.1f} cm deep by the encoder, and {100.0 * set_m:g} cm was set: "
            "coefficients of a mud depend on the depth; or --position-step is not its travel per count"
        )
    if is_off_curve(stroke.profile, residual_n, largest_n):
        return (
            f"the force is {residual_n:.3f} N off one that grows with the measured depth: the mud has lumps, or the "
            "encoder slips"
        )
    return ""


def _mean_speed_m_s(speeds_m_s: Array) -> float:
    """Return the mean with equal weight for equal travel."""
    return float(np.sum(speeds_m_s**2) / np.sum(speeds_m_s))


# shears


def _analyse_shear(trial: Recorded, stroke: PositionedProfile, expected: Alignment) -> AnalysedTrial:
    profile, travels_m = stroke.profile, stroke.mean_positions_m(expected.lag_s)
    speeds_m_s = stroke.speeds_m_s(expected.lag_s)
    motion, steady = _find_shear(stroke, travels_m, speeds_m_s)
    felt_n = (profile.forces_n - profile.zero_n)[steady]
    speed_terms = stroke.speed_terms(expected.lag_s)[steady]
    weights = np.clip(np.gradient(travels_m[steady]), 1e-9, None)
    forces_n = felt_n / (1.0 + expected.rate_fraction * speed_terms)
    mean_n = float(np.average(forces_n, weights=weights))
    if mean_n <= 0.0:
        raise StrokeError("the force does not oppose the motion")
    rate_n = mean_n * expected.rate_uncertainty * float(np.average(speed_terms, weights=weights))
    error_n, remark = steadiness(forces_n)
    moment_m3 = stroke.settings.moment_m3
    return AnalysedTrial(
        recorded=trial,
        profile=profile,
        strokes={"k_s": motion},
        speed_m_s=_mean_speed_m_s(speeds_m_s[steady]),
        coefficients={"k_s": Coefficient(mean_n / moment_m3, hypot(error_n, rate_n) / moment_m3)},
        remark=remark,
        shared_uncertainty=abs(rate_n) / mean_n,
        positions_m=travels_m,
        position_error_m=stroke.interpolation_error_m,
        alignment=fit_rate(felt_n, speed_terms),
    )


def _find_shear(stroke: PositionedProfile, travels_m: Array, speeds_m_s: Array) -> tuple[PlateStroke, Mask]:
    """Return the motion, and the samples of its second half that count. Raises StrokeError."""
    times_s, set_m = stroke.profile.times_s, stroke.settings.shear_path_m
    known = np.isfinite(travels_m)
    travelled_m = float(np.max(travels_m[known], initial=0.0))
    if travelled_m < 0.5 * set_m:
        seen = f"the encoder saw {100.0 * travelled_m:.1f} cm of {100.0 * set_m:g} cm"
        raise StrokeError(f"{seen}: did the stage stop early, {WRONG_AXIS}")
    begin = np.flatnonzero(travels_m > 0.01 * travelled_m)[0]
    steady = known.copy()
    resting_m_s = RESTING_FRACTION * stroke.settings.speed_m_s
    steady[known] = moving(travels_m[known], speeds_m_s[known], resting_m_s, WAKING_SIDEWAYS_M)
    steady &= (travels_m > travelled_m / 2.0) & (travels_m < 0.99 * travelled_m)
    if np.count_nonzero(steady) < 8:
        raise StrokeError("fewer than 8 samples with force and position in the second half of the travel")
    from_s, to_s = float(times_s[steady][0]), float(times_s[steady][-1])
    return PlateStroke(float(times_s[begin]), to_s, steady_s=from_s), steady
