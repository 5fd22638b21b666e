"""Checks the positions and currents as they were logged: units, swapped columns, signals that hang.

What makes every number wrong is refused. What spoils some rows is a finding, and the signal is NaN in those rows.
"""

import math

import numpy as np
from numpy.typing import NDArray

from control.records import FLIPPERS, Phase
from logs.lab.columns import CURRENT_COLUMNS, POSITION_COLUMNS
from logs.lab.findings import FindingKind
from logs.lab.log_rows import LogRows, runs

Floats = NDArray[np.float64]

SWEEP_RANGE_DEG, ADDUCTION_RANGE_DEG = 100.0, 90.0  # to either side; beyond it the arm meets body or joint
RANGES_DEG = (SWEEP_RANGE_DEG, ADDUCTION_RANGE_DEG) * 2
CURRENT_RANGE_A = 120.0  # peak of the largest drive of this kind; the robot's drives clip at 10 to 25 A
MOST_BEYOND = 0.05  # of the rows of the gait; fewer are disturbed samples, more are wrong units
CLEAR_TRAVEL_RAD = 0.1
STUCK_S, STUCK_VALUES = 0.3, 10  # a signal hangs for longer while the other has more values; the drives sample at 50 Hz
LEAP_RAD = 0.0175  # 1°: ten times what an encoder resolves, and less than any joint moves in STUCK_S of a stroke
MOVING = ((Phase.STANCE, Phase.SWING), (Phase.INSERTION, Phase.EXTRACTION)) * 2  # the phases in which each joint moves
STALE_S = 0.5  # both hang; the logger repeats a state for up to 0.35 s
AT_PEAK = 0.9995  # of the largest current: there the drive clips it, and it does not vary


def check_ranges(rows: LogRows, angle_rad: Floats, current_a: Floats) -> None:
    """Invalidate samples beyond the mechanism and refuse a log that is mostly beyond it. Raises LogError."""
    for joint, position in enumerate(POSITION_COLUMNS):
        limit_deg = RANGES_DEG[joint]
        reason = f"turns are beyond ±{limit_deg:.0f}°, which the joint does not reach; positions are logged in turns"
        _check_range(rows, position, angle_rad[:, joint], math.radians(limit_deg), reason, math.tau)
    for joint, current in enumerate(CURRENT_COLUMNS):
        _check_range(rows, current, current_a[:, joint], CURRENT_RANGE_A, f"A are beyond ±{CURRENT_RANGE_A:.0f} A")


def _check_range(
    rows: LogRows, column: str, values: Floats, limit: float, reason: str, logged_unit: float = 1.0
) -> None:
    beyond = (np.abs(values) > limit) & rows.in_gait
    count, rows_in_gait = int(np.count_nonzero(beyond)), int(np.count_nonzero(rows.in_gait))
    if not count:
        return
    first = int(np.argmax(beyond))
    value = f"{values[first] / logged_unit:.4g}"
    text = f"{value} {reason}; so {'is' if count == 1 else 'are'} {count} of {rows_in_gait} rows of the gait"
    if count > MOST_BEYOND * rows_in_gait:
        hint = "; are the units radians or degrees, or are positions and currents swapped?"
        raise rows.refusal(FindingKind.RANGE, column, first, text + hint * column.endswith("_pos"))
    rows.report(FindingKind.RANGE, column, first, text + ", which are left out")
    values[beyond] = np.nan


def check_swapped_joints(rows: LogRows, angle_rad: Floats) -> None:
    """Refuse a flipper that sweeps in insertion and adducts in stance. Raises LogError."""
    for number in range(len(FLIPPERS)):
        sweep, adduction = 2 * number, 2 * number + 1
        stance = np.abs(rows.change(angle_rad, Phase.STANCE))[[sweep, adduction]]
        insertion = np.abs(rows.change(angle_rad, Phase.INSERTION))[[sweep, adduction]]
        clear = min(stance[1], insertion[0]) > CLEAR_TRAVEL_RAD  # a joint that holds still drifts less
        if clear and stance[1] > stance[0] and insertion[0] > insertion[1]:
            first = int(np.argmax(rows.phase == Phase.STANCE))
            text = f"moves less in stance than {POSITION_COLUMNS[adduction]}, and more in insertion: are they swapped?"
            raise rows.refusal(FindingKind.RANGE, POSITION_COLUMNS[sweep], first, text)


def drop_stuck_signals(rows: LogRows, angle_rad: Floats, current_a: Floats) -> None:
    """Invalidate signals that are bit-identical for a while in which their joint is not."""
    peak_a = float(np.nanmax(np.abs(current_a), initial=0.0))
    stuck = []
    for joint, (position, current) in enumerate(zip(POSITION_COLUMNS, CURRENT_COLUMNS, strict=True)):
        angles, currents = angle_rad[:, joint], current_a[:, joint]
        clipped = np.abs(currents) >= AT_PEAK * peak_a
        stuck += [(current, currents, held) for held in _stuck(rows, currents, angles) if not clipped[held.start]]
        held_angles = [held for held in _stuck(rows, angles, currents) if _must_move(rows, joint, angles, held)]
        stuck += [(position, angles, held) for held in held_angles]
        stale = [held for held in _stale(rows, angles, currents) if not clipped[held.start]]
        stuck += [(position, angles, held) for held in stale] + [(current, currents, held) for held in stale]
    for column, values, held in stuck:
        text = f"has the same value for {_duration_s(rows, held):.2f} s, so it is left out there"
        rows.report(FindingKind.STUCK_SIGNAL, column, held.start, text)
        values[held] = np.nan


def _stuck(rows: LogRows, values: Floats, other: Floats) -> list[slice]:
    """Return the rows in which a signal has one value and the other signal of its joint has many."""
    held = [each for each in _held(values) if _duration_s(rows, each) > STUCK_S and np.any(rows.in_gait[each])]
    return [each for each in held if len(np.unique(other[each])) > STUCK_VALUES]


def _must_move(rows: LogRows, joint: int, angles: Floats, held: slice) -> bool:
    """Return whether a joint moved while its position hung: it leaps then, or strokes passed. Joints also rest."""
    before, after = angles[max(held.start - 1, 0)], angles[min(held.stop, len(angles) - 1)]
    leap_rad = max(abs(after - angles[held.start]), abs(before - angles[held.start]))
    return bool(leap_rad > LEAP_RAD or set(MOVING[joint]) <= set(rows.phase[held].tolist()))


def _stale(rows: LogRows, angles: Floats, currents: Floats) -> list[slice]:
    """Return the rows of a stride in which both signals of a joint hang."""
    held = [each for each in _held(angles + 1j * currents) if _duration_s(rows, each) > STALE_S]
    return [each for each in held if np.all(rows.in_gait[each])]


def _held(values: NDArray[np.float64] | NDArray[np.complex128]) -> list[slice]:
    """Return the rows of each value that is repeated."""
    return [slice(each.start, each.stop + 1) for each in runs(np.diff(values) == 0.0)]


def _duration_s(rows: LogRows, held: slice) -> float:
    return float(rows.time_s[held.stop - 1] - rows.time_s[held.start])
