"""Finds the start of a stroke: the force leaves its zero, which may drift before the stage moves."""

from typing import NamedTuple

import numpy as np

from estimation.strokes.origin_fit import NORMAL_MAD
from experiments.loadcell.analysis.curve_fit import Array

QUIET_S = 0.4  # before a stroke, for zero and noise
LEAST_NOISE_N = 1e-3
CONTACT_NOISES, CONTACT_FRACTION = 6.0, 0.03  # of the largest force
LEAST_FORCE_N = 0.03
RESTLESS_FRACTION = 0.05  # of the largest force, in noise, that hides the beginning
SPIKE_NOISES = 12.0


class StrokeError(Exception):
    """The force does not look like a stroke; the text says what is missing."""


class Profile(NamedTuple):
    """Force against time, with the sign at which mud resists the first motion with a positive force."""

    times_s: Array
    forces_n: Array
    begin: int  # index of the first sample in contact
    level_n: float
    noise_n: float
    turned: bool


def noise_of(forces_n: Array) -> float:
    """Return the standard deviation of steady forces, robust to outliers."""
    return max(NORMAL_MAD * float(np.median(np.abs(forces_n - np.median(forces_n)))), LEAST_NOISE_N)


def find_contact(times_s: Array, forces_n: Array) -> Profile:
    """Find the first sample in contact. Raises StrokeError where there is none, or the stroke had begun before."""
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
    return Profile(times_s, sign * forces_n, begin, sign * level_n, noise_n, turned)


def _leaves_zero(times_s: Array, forces_n: Array, bound_n: float) -> tuple[int, float]:
    """Return the first sample in contact, and the zero just before it."""
    for center_s in np.arange(times_s[0] + QUIET_S, times_s[-1], QUIET_S):
        before, after = np.searchsorted(times_s, [center_s - QUIET_S, center_s + QUIET_S])
        here = int(np.searchsorted(times_s, center_s))
        if here == before:
            continue
        level_n = float(np.median(forces_n[before:here]))
        away = np.abs(forces_n[here : after + 1] - level_n) > bound_n
        begins = np.flatnonzero(away[:-1] & away[1:])
        if len(begins) and (begins[0] > 0 or center_s > times_s[0] + 1.5 * QUIET_S):
            return here + int(begins[0]), level_n
        if len(begins):
            break
    raise StrokeError("the stage was moving already when the recording began, or only single samples left the zero")


def without_spikes(forces_n: Array) -> Array:
    """Replace single samples far from two neighbours that agree, such as a garbled digit or a knock."""
    if len(forces_n) < 5:
        return forces_n
    before, after = forces_n[:-2], forces_n[2:]
    steps = np.abs(np.diff(forces_n))
    usual_n = max(float(np.median(steps)), 1e-6)
    middle_n = (before + after) / 2.0
    apart_n = np.abs(forces_n[1:-1] - middle_n)
    spikes = apart_n > np.maximum(SPIKE_NOISES * usual_n, 3.0 * np.abs(after - before))
    fixed = forces_n.copy()
    fixed[1:-1][spikes] = middle_n[spikes]
    return fixed
