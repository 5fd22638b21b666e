"""A whole walk out of a log, as thin as a picture of it needs: place and forces of one flipper against time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.modes import Mode
from control.records import FLIPPERS
from experiments.trials.stride_profile import Floats, columns_of_row, row_of_columns
from firmware_host.log_reading.log_reader import Log

KEPT = 5  # one row in so many


class WalkProfile(NamedTuple):
    """Times by the robot's clock; NaN where nothing is known."""

    time_s: Floats
    phase: NDArray[np.int64]
    body_m: Floats
    force_x_n: Floats
    force_z_n: Floats


def walk_profile_of(log: Log, flipper: str) -> WalkProfile:
    place = FLIPPERS.index(flipper)
    rows = log.ticks[log.ticks["mode"] == Mode.WALKING][::KEPT]
    return WalkProfile(
        rows["stamp_s"],
        rows["phase"].astype(np.int64),
        rows["body_x_m"],
        rows["force_x_n"][:, place],
        rows["force_z_n"][:, place],
    )


def walk_profile_row(profile: WalkProfile) -> dict[str, list[float | None]]:
    """As JSON can hold it."""
    return row_of_columns(profile._asdict())


def walk_profile_of_row(row: Mapping[str, Any]) -> WalkProfile:
    return WalkProfile(**columns_of_row(row, WalkProfile._fields))
