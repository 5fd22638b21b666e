"""Finds the body's advance, height and pitch in the pose that motion capture recorded.

The authors' capture has its vertical along y, as systems of its maker do by default: in every walk the body starts 6 to
10 cm below the capture's origin in y, at any x and z. The advance is the motion in the horizontal plane, along
the direction in which the stances moved the body. The direction of the largest motion would be wrong: in most of the
authors' walks the body sinks further than it advances.
"""

from math import fsum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.records import UNKNOWN, Phase
from firmware_host.configuration.configuration import CaptureAxis, PoseParameters
from logs.lab.columns import BODY_COLUMNS, ORIENTATION_COLUMNS
from logs.lab.csv_table import CsvTable
from logs.lab.findings import FindingKind
from logs.lab.log_rows import LogRows, runs

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

AXES = "xyz"
VERTICAL_AXIS = PoseParameters().vertical  # of the authors' capture
FROZEN_S, LEAP_M = 0.5, 0.02  # a pose is invalid where it is constant for so long and then changes by so much
FARTHEST_M = 10.0  # from the origin of a capture
MUCH_HEIGHT_M = 0.005  # as much as the depth of a stride; three times the uncertainty of the surface
LEAST_AGREEMENT = 0.7  # of the stances' sum to their path: on average within 45° of the advance
MUCH_PITCH_RAD = 0.06  # lifts or lowers the flipper by 5 mm at 85 mm of sweep to the front


class BodyTrack(NamedTuple):
    """The pose of the body row by row; NaN where it is not known."""

    advance_m: Floats  # horizontal, forward positive
    height_m: Floats  # above the capture's origin
    pitch_rad: Floats  # of the nose upward, since the first known pose


def read_body_track(rows: LogRows, table: CsvTable, vertical: CaptureAxis = VERTICAL_AXIS) -> BodyTrack:
    """Return the track, and report what must be known of it. A file with x alone has the advance alone.

    Raises LogError for positions in another unit.
    """
    unknown, nothing = np.full(len(rows.time_s), UNKNOWN), np.zeros(len(rows.time_s))
    columns = [name for name in BODY_COLUMNS if name in table.column]
    if not columns:
        return BodyTrack(unknown, unknown, unknown)
    lost = _is_lost(np.column_stack([table.column[name] for name in columns]), rows.time_s)
    position_m = np.column_stack([table.column.get(name, nothing) for name in BODY_COLUMNS])
    position_m[lost] = UNKNOWN
    if len(columns) == len(BODY_COLUMNS):
        _refuse_units(rows, position_m)
    up = AXES.index(vertical)
    forward = _find_forward(rows, position_m, up)
    advance_m = unknown if forward is None else position_m @ forward
    height_m = position_m[:, up] if BODY_COLUMNS[up] in columns else unknown
    pitch_rad = unknown if forward is None else np.arcsin(_rise(table, lost, forward, up))
    tilt_rad = np.arccos(_rise(table, lost, np.eye(len(AXES))[up], up))  # of the body's vertical, to any side
    _report_lost(rows, columns[0], lost)
    _report_height(rows, height_m, BODY_COLUMNS[up])
    _report_direction(rows, position_m, up, columns[0])
    _report_tilt(rows, tilt_rad, pitch_rad)
    return BodyTrack(advance_m, height_m, pitch_rad)


def _refuse_units(rows: LogRows, position_m: Floats) -> None:
    """Refuse positions that are mostly beyond a capture's volume. Raises LogError."""
    known = np.flatnonzero(np.isfinite(position_m[:, 0]))
    distance_m = np.linalg.norm(position_m[known], axis=1)
    if len(known) and float(np.median(distance_m)) > FARTHEST_M:
        text = f"the body is {distance_m[0]:.0f} m from the origin: positions are in m"
        raise rows.refusal(FindingKind.POSE, BODY_COLUMNS[0], int(known[0]), text)


def _is_lost(position_m: Floats, stamp_s: Floats) -> Truths:
    """Return the rows with an invalid pose: frozen until it leaps to the true one, or three zeros."""
    zero = np.all(position_m == 0.0, axis=1) & (position_m.shape[1] == len(BODY_COLUMNS))
    known_m = np.where(zero[:, None], np.nan, position_m)
    first = np.flatnonzero(np.any(np.diff(known_m, axis=0, prepend=UNKNOWN) != 0.0, axis=1))
    rows = np.diff(first, append=len(stamp_s))  # number of rows with each pose
    held_s = stamp_s[first + rows - 1] - stamp_s[first]
    leap_m = np.append(np.linalg.norm(np.diff(known_m[first], axis=0), axis=1), 0.0)
    lost: Truths = np.repeat((held_s > FROZEN_S) & (leap_m > LEAP_M), rows) | zero
    return lost


def _find_forward(rows: LogRows, position_m: Floats, up: int) -> Floats | None:
    """Return the horizontal direction in which the stances moved the body; None if they did not."""
    stance_m = rows.change(position_m, Phase.STANCE)
    stance_m[up] = 0.0
    distance_m = float(np.linalg.norm(stance_m))
    return stance_m / distance_m if distance_m > 0.0 else None


def _rise(table: CsvTable, lost: Truths, direction: Floats, up: int) -> Floats:
    """Return the vertical part of the body's axis that had a direction in the first known pose."""
    rise = np.full(len(lost), UNKNOWN)
    if not set(ORIENTATION_COLUMNS) <= table.column.keys():
        return rise
    quaternion = np.column_stack([table.column[name] for name in ORIENTATION_COLUMNS])
    size = np.linalg.norm(quaternion, axis=1)
    known = ~lost & (np.abs(size - 1.0) < 0.01)
    if np.any(known):
        turned = _rotation_matrices(quaternion[known] / size[known, None])
        rise[known] = np.clip(turned[:, up, :] @ (turned[0].T @ direction), -1.0, 1.0)
    return rise


def _rotation_matrices(quaternion: Floats) -> Floats:
    """Return the matrices (n, 3, 3) that turn the body's axes into the capture's, of unit quaternions x, y, z, w."""
    vector, scalar = quaternion[:, :3], quaternion[:, 3, None, None]
    x, y, z = vector.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    matrices: Floats = np.eye(3) + 2.0 * (scalar * cross + cross @ cross)
    return matrices


def _report_lost(rows: LogRows, column: str, lost: Truths) -> None:
    """Report that motion capture lost the body, unless it never saw it."""
    periods = runs(lost)
    if not periods or np.all(lost):
        return
    lost_s = fsum(float(rows.time_s[each.stop - 1] - rows.time_s[each.start]) for each in periods)
    text = f"motion capture lost the body for {lost_s:.2f} s, in {len(periods)} period{'s' * (len(periods) > 1)}"
    rows.report(FindingKind.POSE, column, periods[0].start, text)


def _report_height(rows: LogRows, height_m: Floats, column: str) -> None:
    change_m, row = largest_change(height_m, rows.phase)
    if abs(change_m) < MUCH_HEIGHT_M:
        return
    verb = "sinks" if change_m < 0.0 else "rises"
    text = (
        f"the body {verb} by {1e3 * abs(change_m):.0f} mm after the first insertion; depths are those of a body at rest"
    )
    rows.report(FindingKind.POSE, column, row, text)


def _report_direction(rows: LogRows, position_m: Floats, up: int, column: str) -> None:
    """Report stances that moved the body to different sides: then the direction of the advance is not certain."""
    strokes = [np.delete(position_m[each], up, axis=1) for each in rows.strokes(Phase.STANCE)]
    known = [stroke[np.isfinite(stroke[:, 0])] for stroke in strokes]
    steps_m = np.array([stroke[-1] - stroke[0] for stroke in known if len(stroke)])
    if not len(steps_m):
        return
    sum_m, path_m = float(np.linalg.norm(steps_m.sum(axis=0))), float(np.linalg.norm(steps_m, axis=1).sum())
    if sum_m >= LEAST_AGREEMENT * path_m:
        return
    path = f"{1e3 * path_m:.0f} mm in different horizontal directions, {1e3 * sum_m:.0f} mm in all"
    text = f"the stances moved the body by {path}: the direction of the advance is uncertain"
    rows.report(FindingKind.POSE, column, int(np.argmax(rows.phase == Phase.STANCE)), text)


def _report_tilt(rows: LogRows, tilt_rad: Floats, pitch_rad: Floats) -> None:
    tilt_rad = np.where(np.isfinite(tilt_rad) & rows.in_gait, tilt_rad, 0.0)
    row = int(np.argmax(tilt_rad))
    if tilt_rad[row] < MUCH_PITCH_RAD:
        return
    pitch = (
        f"{np.degrees(pitch_rad[row]):+.0f}° of it nose up" if np.isfinite(pitch_rad[row]) else "its side is not known"
    )
    text = f"the body tilts by {np.degrees(tilt_rad[row]):.0f}° from its first pose, {pitch}"
    rows.report(FindingKind.POSE, ORIENTATION_COLUMNS[0], row, text)


def largest_change(values: Floats, phase: NDArray[np.int64]) -> tuple[float, int]:
    """Return the largest change since the first insertion with a known value, and its row; 0 where none is known."""
    later = np.isfinite(values) & (np.cumsum(phase == Phase.INSERTION) > 0)
    if not np.any(later):
        return 0.0, 0
    change = np.where(later, values - values[np.argmax(later)], 0.0)
    row = int(np.argmax(np.abs(change)))
    return float(change[row]), row
