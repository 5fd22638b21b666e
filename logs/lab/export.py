"""Writes logs of this project in the form that the paper's authors publish."""

import math
import tomllib
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from control.records import JOINTS, Phase, Rig
from logs.files.log_error import LogError, Watch, unwatched
from logs.files.log_reader import AnyLog, watched_blocks
from logs.files.tick_array import Ticks
from logs.lab.columns import (
    BACKWARD,
    BODY_COLUMNS,
    DEPTH_COLUMN,
    JOINT_COLUMNS,
    STATE_OF_PHASE,
    WRITTEN_ORDER,
)

Floats = NDArray[np.float64]


def write_lab_csv(log: AnyLog, out: TextIO, watch: Watch = unwatched) -> None:
    """Write the authors' head, columns and units. The settings are the gait and the depth of the first stride.

    Raises LogError.
    """
    settings, has_position = _read_ahead(log)
    settings |= {name: str(value) for name, value in _gait_of(log).items() if isinstance(value, int | float)}
    out.write(f"{','.join(settings)}\n{','.join(settings.values())}\n")
    start_s = log.ends["stamp_s"][:1]
    names = list(_columns(log.ends[:0], log.rig, start_s, has_position))
    out.write(",".join(names) + "\n")
    formats = ["%d" if name == "turtle_state" else "%.9g" for name in names]
    for ticks in watched_blocks(log, watch, "rows written"):
        columns = _columns(ticks, log.rig, start_s, has_position)
        np.savetxt(out, np.column_stack([*columns.values()]), fmt=formats, delimiter=",")


def _gait_of(log: AnyLog) -> dict[str, Any]:
    try:
        gait: dict[str, Any] = tomllib.loads(log.configuration_text).get("gait", {})
    except tomllib.TOMLDecodeError as error:
        raise LogError(f"the configuration in the log is not TOML: {error}") from None
    return gait


def _read_ahead(log: AnyLog) -> tuple[dict[str, str], bool]:
    """Return the settings of the walk, and whether there is any position."""
    settings, has_position, swept_rad = {"scenario": "mudskipper"}, False, 0.0
    sweeps = [number for number, joint in enumerate(log.rig.joints) if joint.endswith("_sweep")]
    for ticks in log.blocks():
        inserted = ticks["phase"] == Phase.INSERTION
        if np.any(inserted):
            settings.setdefault("insertion_angle", f"{ticks['stride_depth_m'][inserted][0]:.9g}")
        has_position = has_position or bool(np.any(np.isfinite(ticks["body_x_m"])))
        pushes = np.isin(ticks["phase"], (Phase.STANCE, Phase.STROKE))
        steps_rad = np.diff(ticks["angle_rad"][:, sweeps], axis=0)
        swept_rad += float(np.nansum(steps_rad[pushes[1:] & pushes[:-1]]))
    return settings | ({BACKWARD: "1"} if swept_rad > 0.0 else {}), has_position


def _columns(ticks: Ticks, rig: Rig, start_s: Floats, has_position: bool) -> dict[str, Floats]:
    state_of = np.array([STATE_OF_PHASE[phase] for phase in Phase])
    columns = {"time": ticks["stamp_s"] - start_s, "turtle_state": state_of[ticks["phase"]]}
    for joint in WRITTEN_ORDER:
        columns[f"{JOINT_COLUMNS[joint]}_pos"] = _of_joint(ticks["angle_rad"], rig, JOINTS[joint]) / math.tau
    for joint in WRITTEN_ORDER:
        columns[f"{JOINT_COLUMNS[joint]}_curr"] = _of_joint(ticks["current_a"], rig, JOINTS[joint])
    columns[DEPTH_COLUMN] = ticks["stride_depth_m"]
    if has_position:
        columns[BODY_COLUMNS[0]] = ticks["body_x_m"]
    return columns


def _of_joint(values: Floats, rig: Rig, joint: str) -> Floats:
    """Return the values of one joint; zeros for an absent motor, as the authors log it."""
    return values[:, rig.joints.index(joint)] if joint in rig.joints else np.zeros(len(values))
