"""The strokes of a stage whose place is measured: where the mud's surface is, and which samples tell something.

A stage that is pushed by hand goes at any speed and rests on its way. Its place is known (stage_track.py); what is not
is the surface's place z_0, and by how much forces are stamped later than places. Both come out of one fit of the force
to the depth z = place(t - lag) - z_0, down and up together:

    down    F = level + (rise z + perhaps a jump at the surface) g       up    F = level + (a chain of lines in z) g

with g for the speed (alignment.py). A lag that is wrong moves a fast piece of way farther than a slow one, and
the way down against the way up, which is what tells it. Where the stage rests mud relaxes, so samples at rest, and of
the next millimetres, tell nothing.
"""

from __future__ import annotations

from functools import partial
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.loadcell.alignment import RESTING_FRACTION, Alignment, PlacedProfile
from experiments.loadcell.contact import LEAST_FORCE_N, StrokeError
from experiments.loadcell.curve_fit import Array, CurveFit, Prior, fit_curve, saved_by
from experiments.loadcell.motion import JUMP_PRICE, KNOTS, REVERSAL_FRACTION, YIELD_M

Mask = NDArray[np.bool_]

WAKING_M = 0.002  # in which mud that has rested bears as before; across the plate it takes more
WAKING_SIDEWAYS_M = 0.005
AIR_M = 0.012  # above the contact, that tells the level
BOTTOM_M = 3e-4  # above the deepest place, that counts as there
LEAST_SAMPLES = 6  # in the mud
LEAST_AIR = 4
LEAST_FRACTION = 0.3  # of the set depth, that an encoder on this stage must have seen
ROUNDS = 3  # of choosing samples by the lag and fitting the lag to them
LAG_STARTS_S = (-0.02, 0.0, 0.02)
NARROW_S = 0.01
TURNING_S, LARGEST_LAG_S = 0.01, 0.3
PARTS = 4  # of the time of a conversion, in which a plate may meet the surface
LAW_FRACTION = 0.015  # of the largest force, by which no law is better
WRONG_AXIS = "is the encoder on the axis that moves, and is --position-step its way per count?"


class MeasuredInsertion(NamedTuple):
    """By the samples of the force."""

    depths_m: Array  # NaN where the encoder does not tell
    grips: Array  # g
    down: Mask  # samples in the mud on the way down, in which the stage moved and the mud was awake
    up: Mask
    level_n: float
    up_level_n: float
    alignment: Alignment
    surface_std_error_m: float
    residual_n: float
    surface_s: float
    stop_s: float
    lift_s: float
    out_s: float
    mean_speed_m_s: float  # on the way down in the mud, every piece of way alike

    @property
    def deepest_m(self) -> float:
        return float(np.nanmax(self.depths_m))


class _Window(NamedTuple):
    """Which samples are fitted, and the stage's places at the surface, about, and at the bottom."""

    down: Mask
    up: Mask
    surface_m: float
    deepest_m: float
    has_air: bool  # behind the way up, which tells its own level: mud that clings weighs something


def find_insertion(placed: PlacedProfile, expected: Alignment) -> MeasuredInsertion:
    """Raises StrokeError where the encoder has not seen the stroke."""
    wide = expected.lag_uncertainty_s > NARROW_S
    lag_s = _rough_lag_s(placed) if wide else expected.lag_s
    for round_ in range(ROUNDS if wide else 1):
        window = _window(placed, lag_s)
        shifts_s = LAG_STARTS_S if wide and round_ == 0 else (0.0,)
        starts = [np.array([window.surface_m - YIELD_M, lag_s + shift, expected.rate_fraction]) for shift in shifts_s]
        fit = _best_fit(placed, expected, window, starts)
        lag_s = float(fit.parameters[1])
    return _insertion(placed, window, fit)


def _rough_lag_s(placed: PlacedProfile) -> float:
    """The force turns round a moment after the stage has left its lowest place; 0 where neither is to be seen."""
    times_s, forces_n = placed.profile.times_s, placed.profile.forces_n - placed.profile.level_n
    positions_m, lowest = placed.track.positions_m(times_s), int(np.argmin(forces_n))
    at_bottom = np.flatnonzero(positions_m > np.max(positions_m) - BOTTOM_M)
    pushed = np.flatnonzero(forces_n[:lowest] > 0.0)
    if forces_n[lowest] > -LEAST_FORCE_N or not len(pushed):
        return 0.0
    lag_s = float(times_s[pushed[-1]] - times_s[at_bottom[-1]]) - TURNING_S
    return lag_s if abs(lag_s) < LARGEST_LAG_S else 0.0


def _window(placed: PlacedProfile, lag_s: float) -> _Window:
    positions_m, speeds_m_s = placed.mean_positions_m(lag_s), placed.speeds_m_s(lag_s)
    known, order = np.isfinite(positions_m), np.arange(len(positions_m))
    touched_s = placed.profile.times_s[placed.profile.begin]
    surface_m = float(placed.track.positions_m(np.array([touched_s - lag_s]))[0])
    deepest_m = float(np.max(positions_m[known], initial=surface_m))
    path_m = deepest_m - surface_m
    if path_m < LEAST_FRACTION * placed.settings.depth_m:
        raise StrokeError(f"the encoder saw {1000.0 * path_m:.1f} mm of the way into the mud: {WRONG_AXIS}")
    at_bottom = order[known][positions_m[known] > deepest_m - BOTTOM_M]
    above = known & (positions_m > surface_m - AIR_M)
    bearing = positions_m < surface_m + (1.0 - REVERSAL_FRACTION) * path_m
    resting_m_s = RESTING_FRACTION * placed.settings.speed_m_s
    down, up = above & (order < at_bottom[0]), known & (order > at_bottom[-1])
    mud = positions_m > surface_m - YIELD_M  # air does not relax
    down[down] = moving(positions_m[down], speeds_m_s[down], resting_m_s, WAKING_M, mud[down])
    up[up] = moving(-positions_m[up], -speeds_m_s[up], resting_m_s, WAKING_M, mud[up])
    up &= bearing & above
    if np.count_nonzero(down & (positions_m > surface_m)) < LEAST_SAMPLES:
        raise StrokeError(f"fewer than {LEAST_SAMPLES} samples of force and place together on the way down")
    has_air = bool(np.count_nonzero(up & (positions_m < surface_m - YIELD_M)) >= LEAST_AIR)
    return _Window(down, up, surface_m, deepest_m, has_air)


def moving(
    positions_m: Array, speeds_m_s: Array, resting_m_s: float, waking_m: float, in_mud: Mask | bool = True
) -> Mask:
    """Samples in which the stage goes forward, goes on, and has done so for `waking_m` since it last rested in mud."""
    goes = speeds_m_s > resting_m_s
    goes &= np.append(goes[1:], False)
    rested_m = np.where(goes | ~np.asarray(in_mud), -np.inf, positions_m)
    return np.asarray(goes & (positions_m - np.maximum.accumulate(rested_m) > waking_m))


def _best_fit(placed: PlacedProfile, expected: Alignment, window: _Window, starts: list[Array]) -> CurveFit:
    """With a jump at the surface only where it pays."""
    y = placed.profile.forces_n[window.down | window.up]
    noise_n = max(placed.profile.noise_n, LAW_FRACTION * float(np.max(np.abs(y - placed.profile.level_n))))
    prior = Prior(
        np.array([0.0, expected.lag_s, expected.rate_fraction]),
        np.array([np.inf, expected.lag_uncertainty_s, expected.rate_uncertainty]),
    )
    kink, jump = (
        fit_curve(partial(_shapes, placed, window, jumps), y, starts, prior, noise_n) for jumps in (False, True)
    )
    pays = jump.factors[2] > 0.0 and saved_by(jump, kink, len(y)) > JUMP_PRICE
    return jump if pays else kink


def _shapes(placed: PlacedProfile, window: _Window, jumps: bool, parameters: Array) -> Array:
    """Columns: level, rise and jump of the way down, the level of the way up and its chain. What does not grow evenly
    with the depth is the mean over the parts of a conversion.
    """
    surface_m, lag_s, rate_fraction = (float(each) for each in parameters)
    chosen = window.down | window.up
    down, knots_m = window.down[chosen], KNOTS * (window.deepest_m - surface_m)
    until_s, part_s = placed.profile.times_s[chosen] - lag_s, placed.period_s / PARTS
    columns = np.zeros((len(until_s), 2 + len(KNOTS)))
    for part in range(PARTS):
        wet_m = np.clip(placed.track.positions_m(until_s - (part + 0.5) * part_s) - surface_m, 0.0, None)
        columns[:, 0] += wet_m / placed.settings.depth_m
        columns[:, 1] += jumps * np.clip(wet_m / YIELD_M, 0.0, 1.0)
        for knot, unit in enumerate(np.eye(len(KNOTS))[1:]):
            columns[:, 2 + knot] += np.interp(wet_m, knots_m, unit)
    columns *= placed.grips(lag_s, rate_fraction)[chosen, None] / PARTS
    columns[~down, :2] = columns[down, 2:] = 0.0
    columns[:, -1] = ~down & window.has_air
    return np.column_stack([down | (not window.has_air), columns]).astype(np.float64)


def _insertion(placed: PlacedProfile, window: _Window, fit: CurveFit) -> MeasuredInsertion:
    surface_m, lag_s, rate_fraction = (float(each) for each in fit.parameters)
    depths_m, times_s = placed.mean_positions_m(lag_s) - surface_m, placed.profile.times_s
    wet = np.flatnonzero(depths_m > 0.0)
    bottom = np.flatnonzero(depths_m > np.nanmax(depths_m) - BOTTOM_M)
    down = window.down & (depths_m > 0.0)
    return MeasuredInsertion(
        depths_m=depths_m,
        grips=placed.grips(lag_s, rate_fraction),
        down=down,
        up=window.up & (depths_m > 0.0),
        level_n=float(fit.factors[0]),
        up_level_n=float(fit.factors[-1 if window.has_air else 0]),
        alignment=Alignment(lag_s, rate_fraction, float(fit.std_errors[1]), float(fit.std_errors[2])),
        surface_std_error_m=float(fit.std_errors[0]),
        residual_n=sqrt(fit.square / np.count_nonzero(window.down | window.up)),
        surface_s=float(times_s[wet[0]]),
        stop_s=float(times_s[bottom[0]]),
        lift_s=float(times_s[bottom[-1]]),
        out_s=float(times_s[wet[-1]]),
        mean_speed_m_s=_mean_speed_m_s(placed.speeds_m_s(lag_s)[down]),
    )


def _mean_speed_m_s(speeds_m_s: Array) -> float:
    """Every piece of way alike, however long it took."""
    return float(np.sum(speeds_m_s**2) / np.sum(speeds_m_s))


class MeasuredShear(NamedTuple):
    ways_m: Array  # of the stage since it began, by the samples of the force; NaN where the encoder does not tell
    quickness: Array
    steady: Mask  # the second half of the way, where the stage moved and the mud was awake
    begin_s: float
    mean_speed_m_s: float


def find_shear(placed: PlacedProfile, lag_s: float) -> MeasuredShear:
    """Raises StrokeError where the encoder has not seen half of the way."""
    ways_m, speeds_m_s, set_m = placed.mean_positions_m(lag_s), placed.speeds_m_s(lag_s), placed.settings.shear_path_m
    known = np.isfinite(ways_m)
    whole_m = float(np.max(ways_m[known], initial=0.0))
    if whole_m < 0.5 * set_m:
        reported = f"the encoder saw {100.0 * whole_m:.1f} cm of {100.0 * set_m:g} cm"
        raise StrokeError(f"{reported}: did the stage stop early, {WRONG_AXIS}")
    begin = np.flatnonzero(ways_m > 0.01 * whole_m)[0]
    steady = known.copy()
    resting_m_s = RESTING_FRACTION * placed.settings.speed_m_s
    steady[known] = moving(ways_m[known], speeds_m_s[known], resting_m_s, WAKING_SIDEWAYS_M)
    steady &= (ways_m > whole_m / 2.0) & (ways_m < 0.99 * whole_m)
    if np.count_nonzero(steady) < 8:
        raise StrokeError("fewer than 8 samples of force and place together on the second half of the way")
    mean_m_s = _mean_speed_m_s(speeds_m_s[steady])
    return MeasuredShear(ways_m, placed.quickness(lag_s), steady, float(placed.profile.times_s[begin]), mean_m_s)
