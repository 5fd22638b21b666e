"""A stride or walk of one flipper from a log, row by row: angles, depths, loads and forces as the daemon recorded them.

Forces and loads are the estimator's at that time, with the zero that it had then. Rows without motion are thinned, so
that a stride with pauses of 3 s stays small.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.modes import Mode
from control.records import Phase, Rig
from estimation.stride_clock import STROKES
from logs.files.log_reader import Log

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

STROKE_PERIOD, REST_PERIOD, WALK_PERIOD = 2, 20, 5  # rows per row that stays
DIGITS = 6  # after the point: a microsecond, a micrometre, a micronewton


class StrideProfile(NamedTuple):
    """NaN where nothing is known."""

    time_s: Floats  # of a stride from its first row on, of a walk by the robot's clock
    phase: NDArray[np.int64]  # commanded
    sweep_rad: Floats
    adduction_rad: Floats
    depth_m: Floats  # measured, below the nominal surface
    depth_command_m: Floats
    sweep_nm: Floats  # load of the mud on the joint
    adduction_nm: Floats
    force_x_n: Floats  # forward
    force_z_n: Floats  # up
    body_m: Floats  # along the track

    def during(self, phase: Phase) -> Truths:
        return np.asarray(self.phase == phase, np.bool_)


def profile_of(log: Log, flipper: str, start_s: float) -> StrideProfile:
    """Return the stride under way at `start_s`; no rows where there is none."""
    ticks = log.ticks[log.ticks["mode"] == Mode.WALKING]
    later = np.flatnonzero(ticks["stamp_s"] >= start_s)
    rows = ticks[ticks["stride"] == ticks["stride"][later[0]]] if len(later) else ticks[:0]
    profile = _profile_of_rows(rows[rows["stride"] >= 0], log.rig, flipper)
    return profile._replace(time_s=profile.time_s - profile.time_s[:1])


def profile_of_walk(log: Log, flipper: str) -> StrideProfile:
    """Return the rows of all strides, thinned for a picture."""
    return _profile_of_rows(log.ticks[log.ticks["mode"] == Mode.WALKING][::WALK_PERIOD], log.rig, flipper)


def _profile_of_rows(rows: NDArray[np.void], rig: Rig, flipper: str) -> StrideProfile:
    side = rig.flippers.index(flipper)
    return StrideProfile(
        time_s=rows["stamp_s"],
        phase=rows["phase"].astype(np.int64),
        sweep_rad=rows["angle_rad"][:, 2 * side],
        adduction_rad=rows["angle_rad"][:, 2 * side + 1],
        depth_m=rows["depth_m"][:, side],
        depth_command_m=rows["depth_command_m"],
        sweep_nm=rows["sweep_load_nm"][:, side],
        adduction_nm=rows["adduction_load_nm"][:, side],
        force_x_n=rows["force_x_n"][:, side],
        force_z_n=rows["force_z_n"][:, side],
        body_m=rows["body_x_m"],
    )


def slip_m(profile: StrideProfile, arm_m: float) -> float:
    """Return the plate's slip backwards through the mud in its stance; 0 without a body pose."""
    positions_m = (profile.body_m + arm_m * np.sin(profile.sweep_rad))[profile.during(Phase.STANCE)]
    known_m = positions_m[np.isfinite(positions_m)]
    return float(known_m[0] - known_m.min()) if len(known_m) else 0.0


def thinned(profile: StrideProfile) -> StrideProfile:
    """Keep fewer rows, and the first of every phase."""
    phases, numbers = profile.phase, np.arange(len(profile.phase))
    period = np.where(np.isin(phases, STROKES), STROKE_PERIOD, REST_PERIOD)
    kept = (numbers % period == 0) | np.diff(phases, prepend=-1).astype(bool)
    return StrideProfile(*(column[kept] for column in profile))


def profile_row(profile: StrideProfile) -> dict[str, list[float | None]]:
    """Convert to JSON lists."""
    return {name: [_known(value) for value in column.tolist()] for name, column in profile._asdict().items()}


def profile_from_row(row: Mapping[str, Any]) -> StrideProfile:
    """Convert from JSON lists; a column that an older notebook does not have is empty."""
    columns: dict[str, Any] = {name: np.array(row.get(name, ()), np.float64) for name in StrideProfile._fields}
    return StrideProfile(**columns | {"phase": np.array(row["phase"], np.int64)})


def _known(value: float) -> float | None:
    return round(value, DIGITS) if np.isfinite(value) else None
