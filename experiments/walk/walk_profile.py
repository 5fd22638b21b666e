"""The profile of a whole walk from a log, thinned for a picture: position and forces of one flipper against time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.modes import Mode
from control.records import FLIPPERS
from experiments.trials.stride_profile import Floats, columns_of_row, row_of_columns
from firmware_host.log_reading.log_reader import Log

PERIOD_ROWS = 5  # one row of the log in five


class WalkProfile(NamedTuple):
    """Times are by the robot's clock; unknown values are NaN."""

    time_s: Floats
    phase: NDArray[np.int64]
    body_m: Floats
    force_x_n: Floats
    force_z_n: Floats


def walk_profile_of(log: Log, flipper: str) -> WalkProfile:
    column = FLIPPERS.index(flipper)
    rows = log.ticks[log.ticks["mode"] == Mode.WALKING][::PERIOD_ROWS]
    return WalkProfile(
        rows["stamp_s"],
        rows["phase"].astype(np.int64),
        rows["body_x_m"],
        rows["force_x_n"][:, column],
        rows["force_z_n"][:, column],
    )


def walk_profile_row(profile: WalkProfile) -> dict[str, list[float | None]]:
    """Return the columns as lists for JSON."""
    return row_of_columns(profile._asdict())


def walk_profile_of_row(row: Mapping[str, Any]) -> WalkProfile:
    return WalkProfile(**columns_of_row(row, WalkProfile._fields))
