"""Finds the body's advance in the pose that motion capture recorded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from control.records import UNKNOWN, Phase
from firmware_host.log_reading.lab.columns import BODY_COLUMNS
from firmware_host.log_reading.lab.joint_signs import steps_inside

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Truths = NDArray[np.bool_]

FROZEN_S, LEAP_M = 0.5, 0.02  # a pose is invalid where it is constant for so long and then changes by so much


def body_advance(position_columns_m: list[Floats], stamp_s: Floats, phase: Integers) -> Floats:
    """Returns the body's position along the direction in which the stances moved it.

    The first principal axis would be wrong: in two of the authors' walks the body heaves as far as it advances.
    """
    if not position_columns_m:
        return np.full(len(stamp_s), UNKNOWN)
    position_m = np.column_stack(position_columns_m)
    position_m[_is_lost(position_m, stamp_s)] = UNKNOWN
    stance_m = np.nansum(np.diff(position_m, axis=0)[steps_inside(phase, Phase.STANCE)], axis=0)
    distance_m = float(np.linalg.norm(stance_m))
    if distance_m == 0.0:
        return np.full(len(stamp_s), UNKNOWN)
    advance_m: Floats = position_m @ (stance_m / distance_m)
    return advance_m


def _is_lost(position_m: Floats, stamp_s: Floats) -> Truths:
    """Returns the rows with an invalid pose: frozen until it leaps to the true one, or three zeros."""
    is_new = np.any(np.diff(position_m, axis=0, prepend=UNKNOWN) != 0.0, axis=1)
    first = np.flatnonzero(is_new)
    rows = np.diff(first, append=len(stamp_s))  # number of rows with each pose
    held_s = stamp_s[first + rows - 1] - stamp_s[first]
    leap_m = np.append(np.linalg.norm(np.diff(position_m[first], axis=0), axis=1), 0.0)
    lost: Truths = np.repeat((held_s > FROZEN_S) & (leap_m > LEAP_M), rows)
    if position_m.shape[1] == len(BODY_COLUMNS):
        lost[np.all(position_m == 0.0, axis=1)] = True
    return lost
