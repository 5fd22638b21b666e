"""A stride or walk of one flipper from a log, row by row: angles, depths, loads and forces as the daemon recorded them.

A profile is a data frame with the columns of COLUMNS and OF_FLIPPER; NaN where nothing is known. Forces and loads are
the estimator's at that time, with the zero that it had then. Rows without motion are thinned, so that a stride with
pauses of 3 s stays small.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from control.modes import Mode
from control.records import Phase
from estimation.stride_clock import STROKES
from logs.files.log_reader import Log

COLUMNS = ("stamp_s", "stride", "phase", "depth_command_m", "body_x_m")
OF_FLIPPER = ("depth_m", "sweep_load_nm", "adduction_load_nm", "force_x_n", "force_z_n")
STROKE_PERIOD, REST_PERIOD, WALK_PERIOD = 2, 20, 5  # rows per row that stays
DIGITS = 6  # after the point: a microsecond, a micrometre, a micronewton


def walk_profile(log: Log, flipper: str, period: int = 1) -> DataFrame:
    """Return every row of all strides, or one in a period, at `time_s` by the robot's clock."""
    return _profile_of_rows(_walking_rows(log)[::period], log, flipper)


def _walking_rows(log: Log) -> NDArray[np.void]:
    rows: NDArray[np.void] = log.ticks[log.ticks["mode"] == Mode.WALKING]
    return rows


def _profile_of_rows(rows: NDArray[np.void], log: Log, flipper: str) -> DataFrame:
    side = log.rig.flippers.index(flipper)
    profile = {name: rows[name] for name in COLUMNS} | {name: rows[name][:, side] for name in OF_FLIPPER}
    angles_rad = rows["angle_rad"][:, 2 * side : 2 * side + 2].T
    profile |= dict(zip(("sweep_rad", "adduction_rad"), angles_rad, strict=True))
    return DataFrame(profile).rename(columns={"stamp_s": "time_s"})


def profile_of(log: Log, flipper: str, start_s: float) -> DataFrame:
    """Return the stride under way at `start_s`, at `time_s` from its first row on; no rows where there is none."""
    rows = _walking_rows(log)
    under_way = rows["stride"][rows["stamp_s"] >= start_s][:1]
    profile = _profile_of_rows(rows[np.isin(rows["stride"], under_way) & (rows["stride"] >= 0)], log, flipper)
    return profile.assign(time_s=profile["time_s"] - profile["time_s"].min())


def stroke_of(profile: DataFrame, phase: Phase) -> DataFrame:
    return profile[profile["phase"] == phase]


def slip_m(profile: DataFrame, arm_m: float) -> float:
    """Return the plate's slip backwards through the mud in its stance; 0 without a body pose."""
    stance = stroke_of(profile, Phase.STANCE)
    positions_m = (stance["body_x_m"] + arm_m * np.sin(stance["sweep_rad"])).dropna()
    return float(positions_m.iloc[0] - positions_m.min()) if len(positions_m) else 0.0


def thinned(profile: DataFrame) -> DataFrame:
    """Keep fewer rows, and the first of every phase."""
    period = np.where(profile["phase"].isin(STROKES), STROKE_PERIOD, REST_PERIOD)
    return profile[(np.arange(len(profile)) % period == 0) | (profile["phase"] != profile["phase"].shift())]


def profile_lists(profile: DataFrame) -> dict[str, list[Any]]:
    """Convert to JSON lists by column."""
    rounded = profile.round(DIGITS).astype(object)
    return dict(rounded.where(profile.notna(), None).to_dict("list"))


def profile_from(entry: dict[str, Any]) -> DataFrame:
    """Return the profile in an entry of a notebook."""
    return DataFrame(entry["course"], dtype=float)
