"""One stride of one flipper out of a log, row by row: angles, depths, loads and forces, as the daemon recorded them.

Forces and loads are those that the daemon's estimator showed at the time, with the zero that it had taken by then.
Rows in which nothing moves are thinned, so that the course of a stride with pauses of 3 s stays small beside its log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.modes import Mode
from control.records import FLIPPERS, Phase
from firmware_host.log_reading.log_reader import Log

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

STROKES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION)
KEPT_OF_STROKE, KEPT_OF_REST = 2, 20  # one row in so many
DIGITS = 6  # behind the point: a microsecond, a micrometre, a micronewton


class StrideProfile(NamedTuple):
    """Times from the first row on; NaN where nothing is known."""

    time_s: Floats
    phase: NDArray[np.int64]  # commanded
    sweep_rad: Floats
    adduction_rad: Floats
    depth_m: Floats  # measured, below the nominal surface
    depth_command_m: Floats
    sweep_nm: Floats  # what the mud does to the joint
    adduction_nm: Floats
    force_x_n: Floats  # forward
    force_z_n: Floats  # up
    body_m: Floats  # along the track

    def during(self, phase: Phase) -> Truths:
        return np.asarray(self.phase == phase, np.bool_)


def profile_of(log: Log, flipper: str, start_s: float) -> StrideProfile:
    """Of the stride that was under way at `start_s`; without rows where there was none."""
    ticks, place = log.ticks, FLIPPERS.index(flipper)
    ticks = ticks[ticks["mode"] == Mode.WALKING]
    begun = np.flatnonzero(ticks["stamp_s"] >= start_s)
    rows = ticks[ticks["stride"] == ticks["stride"][begun[0]]] if len(begun) else ticks[:0]
    rows = rows[rows["stride"] >= 0]
    return StrideProfile(
        rows["stamp_s"] - (rows["stamp_s"][0] if len(rows) else 0.0),
        rows["phase"].astype(np.int64),
        rows["angle_rad"][:, 2 * place],
        rows["angle_rad"][:, 2 * place + 1],
        rows["depth_m"][:, place],
        rows["depth_command_m"],
        rows["sweep_load_nm"][:, place],
        rows["adduction_load_nm"][:, place],
        rows["force_x_n"][:, place],
        rows["force_z_n"][:, place],
        rows["body_x_m"],
    )


def slip_m(profile: StrideProfile, arm_m: float) -> float:
    """How far back through the mud the plate came in its stance; 0 where no pose tells the body's place."""
    positions_m = (profile.body_m + arm_m * np.sin(profile.sweep_rad))[profile.during(Phase.STANCE)]
    seen_m = positions_m[np.isfinite(positions_m)]
    return float(seen_m[0] - seen_m.min()) if len(seen_m) else 0.0


def thinned(profile: StrideProfile) -> StrideProfile:
    """With fewer rows, but the first of every phase."""
    phases, numbers = profile.phase, np.arange(len(profile.phase))
    period = np.where(np.isin(phases, STROKES), KEPT_OF_STROKE, KEPT_OF_REST)
    kept = (numbers % period == 0) | np.diff(phases, prepend=-1).astype(bool)
    return StrideProfile(*(column[kept] for column in profile))


def profile_row(profile: StrideProfile) -> dict[str, list[float | None]]:
    """As JSON can hold it."""
    return row_of_columns(profile._asdict())


def profile_from_row(row: Mapping[str, Any]) -> StrideProfile:
    return StrideProfile(**columns_of_row(row, StrideProfile._fields))


def row_of_columns(columns: Mapping[str, NDArray[Any]]) -> dict[str, list[float | None]]:
    return {name: [known(value) for value in column.tolist()] for name, column in columns.items()}


def columns_of_row(row: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Phases are whole numbers, all others are not."""
    return {name: np.array(row[name], np.int64 if name == "phase" else np.float64) for name in names}


def known(value: float) -> float | None:
    return round(value, DIGITS) if np.isfinite(value) else None
