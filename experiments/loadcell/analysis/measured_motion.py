"""Strokes of a stage with an encoder: the surface of the mud, and the samples that count.

A stage that is pushed by hand moves at any speed and rests on its way. Its position is measured (stage_track.py). The
surface z_0 and the lag of the forces come out of one fit of the force to the depth z = position(t - lag) - z_0, down
and up together:

    down    F = level + (rise z + perhaps a jump at the surface) g       up    F = level + (a chain of lines in z) g

with the speed factor g (stage_track.py). A wrong lag moves fast parts of the stroke farther than slow ones, and the way
down against the way up, which makes it observable. Where the stage rests the mud relaxes, so samples at rest, and over
the next millimetres, do not count.
"""

from functools import partial
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.loadcell.analysis.contact import LEAST_FORCE_N, StrokeError
from experiments.loadcell.analysis.curve_fit import Array, CurveFit, Prior, cheaper_fit, fit_curve
from experiments.loadcell.analysis.force_motion import (
    JUMP_PRICE,
    KNOTS,
    REVERSAL_FRACTION,
    YIELD_M,
    Extraction,
    Insertion,
    Pace,
    Shear,
)
from experiments.loadcell.analysis.stage_track import RESTING_FRACTION, Alignment, PositionedProfile

Mask = NDArray[np.bool_]

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
WRONG_AXIS = "is the encoder on the axis that moves, and is --position-step its travel per count?"


class MeasuredInsertion(NamedTuple):
    """An insertion and extraction, by the samples of the force."""

    motion: Insertion  # its speed is the mean on the way down in the mud, with equal weight for equal travel
    extraction: Extraction
    depths_m: Array  # NaN where the position is unknown
    speed_factors: Array  # g
    down: Mask  # samples in the mud on the way down that count
    up: Mask
    alignment: Alignment
    surface_std_error_m: float

    @property
    def deepest_m(self) -> float:
        return float(np.nanmax(self.depths_m))


class _Window(NamedTuple):
    """The samples of the fit, and the positions at the surface (roughly) and at the bottom."""

    down: Mask
    up: Mask
    surface_m: float
    deepest_m: float
    has_air: bool  # after the way up, for its own level: clinging mud has weight


def find_insertion(stroke: PositionedProfile, expected: Alignment) -> MeasuredInsertion:
    """Raises StrokeError where the encoder did not see the stroke."""
    wide = expected.lag_uncertainty_s > NARROW_S
    lag_s = _rough_lag_s(stroke) if wide else expected.lag_s
    for round_ in range(ROUNDS if wide else 1):
        window = _window(stroke, lag_s)
        shifts_s = LAG_STARTS_S if wide and round_ == 0 else (0.0,)
        starts = [np.array([window.surface_m - YIELD_M, lag_s + shift, expected.rate_fraction]) for shift in shifts_s]
        fit = _best_fit(stroke, expected, window, starts)
        lag_s = float(fit.parameters[1])
    return _insertion(stroke, window, fit)


def _rough_lag_s(stroke: PositionedProfile) -> float:
    """Estimate the lag from the reversal of the force after the stage leaves the bottom; 0 without a reversal."""
    times_s, forces_n = stroke.profile.times_s, stroke.profile.forces_n - stroke.profile.level_n
    positions_m, lowest = stroke.track.positions_m(times_s), int(np.argmin(forces_n))
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
    surface_m = float(stroke.track.positions_m(np.array([touched_s - lag_s]))[0])
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
    return _Window(down, up, surface_m, deepest_m, has_air)


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
    prior = Prior(
        np.array([0.0, expected.lag_s, expected.rate_fraction]),
        np.array([np.inf, expected.lag_uncertainty_s, expected.rate_uncertainty]),
    )
    kink, jump = (
        fit_curve(partial(_shapes, stroke, window, jumps), y, starts, prior, noise_n) for jumps in (False, True)
    )
    return cheaper_fit(kink, jump, 2, 1.0, JUMP_PRICE, len(y))


def _shapes(stroke: PositionedProfile, window: _Window, jumps: bool, parameters: Array) -> Array:
    """Return columns: level, rise and jump of the way down, then the chain and the level of the way up.

    Columns that are not linear in depth are averaged over the parts of a conversion.
    """
    surface_m, lag_s, rate_fraction = (float(each) for each in parameters)
    chosen = window.down | window.up
    down, knots_m = window.down[chosen], KNOTS * (window.deepest_m - surface_m)
    until_s, part_s = stroke.profile.times_s[chosen] - lag_s, stroke.period_s / PARTS
    columns = np.zeros((len(until_s), 2 + len(KNOTS)))
    for part in range(PARTS):
        wet_m = np.clip(stroke.track.positions_m(until_s - (part + 0.5) * part_s) - surface_m, 0.0, None)
        columns[:, 0] += wet_m / stroke.settings.depth_m
        columns[:, 1] += jumps * np.clip(wet_m / YIELD_M, 0.0, 1.0)
        for knot, unit in enumerate(np.eye(len(KNOTS))[1:]):
            columns[:, 2 + knot] += np.interp(wet_m, knots_m, unit)
    columns *= stroke.speed_factors(lag_s, rate_fraction)[chosen, None] / PARTS
    columns[~down, :2] = columns[down, 2:] = 0.0
    columns[:, -1] = ~down & window.has_air
    return np.column_stack([down | (not window.has_air), columns]).astype(np.float64)


def _insertion(stroke: PositionedProfile, window: _Window, fit: CurveFit) -> MeasuredInsertion:
    surface_m, lag_s, rate_fraction = (float(each) for each in fit.parameters)
    depths_m, times_s = stroke.mean_positions_m(lag_s) - surface_m, stroke.profile.times_s
    wet = np.flatnonzero(depths_m > 0.0)
    bottom = np.flatnonzero(depths_m > np.nanmax(depths_m) - BOTTOM_M)
    down = window.down & (depths_m > 0.0)
    speed_m_s, surface_std_error_m = _mean_speed_m_s(stroke.speeds_m_s(lag_s)[down]), float(fit.std_errors[0])
    level_n, up_level_n = float(fit.factors[0]), float(fit.factors[-1 if window.has_air else 0])
    return MeasuredInsertion(
        motion=Insertion(
            surface_s=float(times_s[wet[0]]),
            surface_std_error_s=surface_std_error_m / speed_m_s,
            stop_s=float(times_s[bottom[0]]),
            pace=Pace(speed_m_s),
            level_n=level_n,
            residual_n=sqrt(fit.square / np.count_nonzero(window.down | window.up)),
        ),
        extraction=Extraction(float(times_s[bottom[-1]]), float(times_s[wet[-1]]), up_level_n),
        depths_m=depths_m,
        speed_factors=stroke.speed_factors(lag_s, rate_fraction),
        down=down,
        up=window.up & (depths_m > 0.0),
        alignment=Alignment(lag_s, rate_fraction, float(fit.std_errors[1]), float(fit.std_errors[2])),
        surface_std_error_m=surface_std_error_m,
    )


def _mean_speed_m_s(speeds_m_s: Array) -> float:
    """Return the mean with equal weight for equal travel."""
    return float(np.sum(speeds_m_s**2) / np.sum(speeds_m_s))


class MeasuredShear(NamedTuple):
    motion: Shear
    travels_m: Array  # of the stage by the samples of the force; NaN where the position is unknown
    steady: Mask  # the samples of the second half that count


def find_shear(stroke: PositionedProfile, lag_s: float) -> MeasuredShear:
    """Raises StrokeError where the encoder did not see half of the travel."""
    travels_m, speeds_m_s = stroke.mean_positions_m(lag_s), stroke.speeds_m_s(lag_s)
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
    return MeasuredShear(
        Shear(float(times_s[begin]), from_s, to_s, _mean_speed_m_s(speeds_m_s[steady])), travels_m, steady
    )
