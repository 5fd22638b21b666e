"""Writes logs of this project in the form that the paper's authors publish."""

import math
import tomllib
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from control.records import JOINTS, Phase
from firmware_host.log_reading.lab.columns import (
    BODY_COLUMNS,
    DEPTH_COLUMN,
    JOINT_COLUMNS,
    STATE_OF_PHASE,
    WRITTEN_ORDER,
)
from firmware_host.log_reading.log_reader import Log, LogError, Watch, unwatched

Floats = NDArray[np.float64]

WATCHED_ROWS = 5000  # between two reports of progress


def write_lab_csv(log: Log, out: TextIO, watch: Watch = unwatched) -> None:
    """Writes the authors' head, columns and units. The settings are the gait and the depth of the first stride."""
    settings = _settings(log)
    out.write(f"{','.join(settings)}\n{','.join(settings.values())}\n")
    table = _columns(log)
    out.write(",".join(table) + "\n")
    formats = ["%d" if name == "turtle_state" else "%.9g" for name in table]
    rows = np.column_stack(list(table.values()))
    for start in range(0, len(rows), WATCHED_ROWS):
        watch("rows written", start, len(rows))
        np.savetxt(out, rows[start : start + WATCHED_ROWS], fmt=formats, delimiter=",")


def _settings(log: Log) -> dict[str, str]:
    depths_m = log.ticks["stride_depth_m"][log.ticks["phase"] == Phase.INSERTION]
    settings = {"scenario": "mudskipper"}
    if len(depths_m):
        settings["insertion_angle"] = f"{depths_m[0]:.9g}"
    return settings | _configured_gait(log.configuration_text)


def _configured_gait(configuration_text: str) -> dict[str, str]:
    try:
        gait = tomllib.loads(configuration_text).get("gait", {})
    except tomllib.TOMLDecodeError as error:
        raise LogError(f"the configuration in the log is not TOML: {error}") from None
    return {name: str(value) for name, value in gait.items() if isinstance(value, int | float)}


def _columns(log: Log) -> dict[str, Floats]:
    stamp_s = log.ticks["stamp_s"]
    state_of = np.array([STATE_OF_PHASE[phase] for phase in Phase])
    columns = {"time": stamp_s - stamp_s[:1], "turtle_state": state_of[log.ticks["phase"]]}
    for joint in WRITTEN_ORDER:
        columns[f"{JOINT_COLUMNS[joint]}_pos"] = _of_joint(log, "angle_rad", JOINTS[joint]) / math.tau
    for joint in WRITTEN_ORDER:
        columns[f"{JOINT_COLUMNS[joint]}_curr"] = _of_joint(log, "current_a", JOINTS[joint])
    columns[DEPTH_COLUMN] = log.ticks["stride_depth_m"]
    if np.any(np.isfinite(log.ticks["body_x_m"])):
        columns[BODY_COLUMNS[0]] = log.ticks["body_x_m"]
    return columns


def _of_joint(log: Log, name: str, joint: str) -> Floats:
    """Returns the values of one joint; zeros for an absent motor, as the authors log it."""
    values: Floats = log.ticks[name]
    return values[:, log.rig.joints.index(joint)] if joint in log.rig.joints else np.zeros(len(values))
