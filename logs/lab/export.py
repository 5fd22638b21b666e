"""Writes logs of this project in the form that the paper's authors publish."""

import math
import tomllib
from typing import NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from control.records import JOINTS, Phase, Rig
from logs.files.log_error import LogError, Watch, unwatched
from logs.files.log_reader import AnyLog, TickPass
from logs.files.tick_array import Ticks
from logs.lab.columns import (
    BODY_COLUMNS,
    DEPTH_COLUMN,
    JOINT_COLUMNS,
    STATE_OF_PHASE,
    WRITTEN_ORDER,
)

Floats = NDArray[np.float64]


class _Heading(NamedTuple):
    """What the first lines of the file say about the rows after them."""

    start_s: Floats  # of the first row; empty without any
    depth_m: float | None  # of the first stride
    has_position: bool


def write_lab_csv(log: AnyLog, out: TextIO, watch: Watch = unwatched) -> TickPass:
    """Writes the authors' head, columns and units. The settings are the gait and the depth of the first stride.

    Returns the pass over the rows, which knows whether the log was cut off meanwhile. Raises LogError.
    """
    heading = _read_heading(log)
    settings = _settings(heading, log.configuration_text)
    out.write(f"{','.join(settings)}\n{','.join(settings.values())}\n")
    names = list(_columns(log.ends[:0], log.rig, heading))
    out.write(",".join(names) + "\n")
    formats = ["%d" if name == "turtle_state" else "%.9g" for name in names]
    rows = TickPass(log, watch, "rows written")
    for ticks in rows:
        np.savetxt(out, np.column_stack([*_columns(ticks, log.rig, heading).values()]), fmt=formats, delimiter=",")
    return rows


def _read_heading(log: AnyLog) -> _Heading:
    """Reads as far into the log as the heading needs."""
    depth_m, has_position = None, False
    for ticks in TickPass(log, unwatched, ""):
        inserted = ticks["phase"] == Phase.INSERTION
        if depth_m is None and np.any(inserted):
            depth_m = float(ticks["stride_depth_m"][inserted][0])
        has_position = has_position or bool(np.any(np.isfinite(ticks["body_x_m"])))
        if has_position and depth_m is not None:
            break
    return _Heading(log.ends["stamp_s"][:1], depth_m, has_position)


def _settings(heading: _Heading, configuration_text: str) -> dict[str, str]:
    depth = {} if heading.depth_m is None else {"insertion_angle": f"{heading.depth_m:.9g}"}
    return {"scenario": "mudskipper"} | depth | _configured_gait(configuration_text)


def _configured_gait(configuration_text: str) -> dict[str, str]:
    try:
        gait = tomllib.loads(configuration_text).get("gait", {})
    except tomllib.TOMLDecodeError as error:
        raise LogError(f"the configuration in the log is not TOML: {error}") from None
    return {name: str(value) for name, value in gait.items() if isinstance(value, int | float)}


def _columns(ticks: Ticks, rig: Rig, heading: _Heading) -> dict[str, Floats]:
    state_of = np.array([STATE_OF_PHASE[phase] for phase in Phase])
    columns = {"time": ticks["stamp_s"] - heading.start_s, "turtle_state": state_of[ticks["phase"]]}
    for joint in WRITTEN_ORDER:
        columns[f"{JOINT_COLUMNS[joint]}_pos"] = _of_joint(ticks["angle_rad"], rig, JOINTS[joint]) / math.tau
    for joint in WRITTEN_ORDER:
        columns[f"{JOINT_COLUMNS[joint]}_curr"] = _of_joint(ticks["current_a"], rig, JOINTS[joint])
    columns[DEPTH_COLUMN] = ticks["stride_depth_m"]
    if heading.has_position:
        columns[BODY_COLUMNS[0]] = ticks["body_x_m"]
    return columns


def _of_joint(values: Floats, rig: Rig, joint: str) -> Floats:
    """Returns the values of one joint; zeros for an absent motor, as the authors log it."""
    return values[:, rig.joints.index(joint)] if joint in rig.joints else np.zeros(len(values))
