"""Reads the CSV logs of the paper's authors into this project's conventions.

The authors logged mirrored motors with signs that differ from file to file, for positions and currents separately.
The reader therefore finds the signs from the motion. A flipper moves down in insertion and backward in stance, so its
angles fall there. Its motors do positive work on the mud there, so the current has the sign of the change of angle. A
joint without such a motion keeps its logged signs. The body moves forward in stance.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.records import FLIPPERS, UNKNOWN
from firmware_host.log_reading.lab.body_track import body_advance
from firmware_host.log_reading.lab.columns import (
    BODY_COLUMNS,
    CURRENT_COLUMNS,
    DEPTH_COLUMN,
    PHASE_OF_STATE,
    POSITION_COLUMNS,
    READ_COLUMNS,
)
from firmware_host.log_reading.lab.csv_table import STATE, TIME, CsvTable, read_table
from firmware_host.log_reading.lab.findings import Finding
from firmware_host.log_reading.lab.joint_signs import orient
from firmware_host.log_reading.log_reader import LogError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Truths = NDArray[np.bool_]

CLIP_FRACTION, CLIPPED_ROWS = 0.9995, 200  # half a second of rows at the largest current makes it a limit
BACKWARDS_S = 1.0  # accepted disorder of the rows' times


class LabLog(NamedTuple):
    """One run: n rows, joints in the order of JOINTS. The joints of an absent flipper are NaN."""

    stamp_s: Floats
    phase: Integers  # of control.records.Phase
    angle_rad: Floats  # (n, 4)
    current_a: Floats  # (n, 4)
    body_x_m: Floats  # horizontal advance; NaN where motion capture did not see the body
    gait: dict[str, float]  # the operator's settings; `insertion_angle` is the commanded depth in m
    flippers: tuple[str, ...]  # the ones that moved
    current_limit_a: float  # at which the drives clipped; infinite where they did not
    commanded_depth_m: Floats  # NaN where the log does not have it
    body_height_m: Floats  # NaN where it is not known
    body_pitch_rad: Floats  # NaN where it is not known
    missing_settings: tuple[str, ...] = ()  # that the head names without a value
    findings: tuple[Finding, ...] = ()


def read_lab_csv(path: Path) -> LabLog:
    """Reads a CSV file, plain or gzip: settings, column names, then a row per sample. Raises LogError."""
    table = read_table(path, READ_COLUMNS)
    _refuse_missing(path, table)
    stamp_s = _check_time(path, table)
    phase = _read_phases(path, table)
    angle_rad = math.tau * _stack(table, POSITION_COLUMNS)
    current_a = _stack(table, CURRENT_COLUMNS)
    flippers = _find_flippers(angle_rad)
    _blank_absent(angle_rad, current_a, flippers)
    orient(angle_rad, current_a, phase)
    body_x_m = body_advance([table.column[name] for name in BODY_COLUMNS if name in table.column], stamp_s, phase)
    return LabLog(
        stamp_s=stamp_s,
        phase=phase,
        angle_rad=angle_rad,
        current_a=current_a,
        body_x_m=body_x_m,
        gait=table.gait,
        flippers=flippers,
        current_limit_a=_find_limit_a(current_a),
        commanded_depth_m=_commanded_depth(table),
        body_height_m=np.full(len(stamp_s), UNKNOWN),
        body_pitch_rad=np.full(len(stamp_s), UNKNOWN),
        missing_settings=table.missing_settings,
        findings=table.findings,
    )


def _refuse_missing(path: Path, table: CsvTable) -> None:
    """Refuses a file without the positions and currents of at least one flipper. Raises LogError."""
    needed = [(*POSITION_COLUMNS[i : i + 2], *CURRENT_COLUMNS[i : i + 2]) for i in range(0, len(POSITION_COLUMNS), 2)]
    if not any(set(names) <= table.column.keys() for names in needed):
        missing = ", ".join(name for names in needed for name in names if name not in table.column)
        raise LogError(f"{path}: there is no column {missing}; positions and currents of one flipper are needed")


def _stack(table: CsvTable, names: tuple[str, ...]) -> Floats:
    """Returns the columns side by side, NaN for those that the file does not have."""
    absent = np.full(len(table.line), np.nan)
    return np.column_stack([table.column.get(name, absent) for name in names])


def _commanded_depth(table: CsvTable) -> Floats:
    depth_m = table.column.get(DEPTH_COLUMN)
    return np.full(len(table.line), table.gait.get("insertion_angle", UNKNOWN)) if depth_m is None else depth_m


def _check_time(path: Path, table: CsvTable) -> Floats:
    stamp_s = table.column[TIME]
    back_s = np.maximum.accumulate(stamp_s) - stamp_s
    _refuse_where(back_s > BACKWARDS_S, path, table, f"goes back in time by more than {BACKWARDS_S:g} s")
    return stamp_s


def _read_phases(path: Path, table: CsvTable) -> Integers:
    state = table.column[STATE]
    _refuse_where(~np.isin(state, list(PHASE_OF_STATE)), path, table, "has a turtle_state that is not known")
    phase_from_lowest = np.array([PHASE_OF_STATE[known] for known in sorted(PHASE_OF_STATE)], dtype=np.int64)
    return phase_from_lowest[state.astype(np.int64) - min(PHASE_OF_STATE)]


def _refuse_where(wrong: Truths, path: Path, table: CsvTable, reason: str) -> None:
    if np.any(wrong):
        raise LogError(f"{path}: line {int(table.line[np.argmax(wrong)])} {reason}")


def _find_flippers(angle_rad: Floats) -> tuple[str, ...]:
    """Returns the flippers that moved."""
    joint_moved = np.any(np.abs(np.diff(angle_rad, axis=0)) > 0.0, axis=0)
    return tuple(name for number, name in enumerate(FLIPPERS) if joint_moved[2 * number : 2 * number + 2].any())


def _blank_absent(angle_rad: Floats, current_a: Floats, flippers: tuple[str, ...]) -> None:
    """Replaces the zeros that the authors logged for absent motors."""
    for number, name in enumerate(FLIPPERS):
        if name not in flippers:
            angle_rad[:, 2 * number : 2 * number + 2] = UNKNOWN
            current_a[:, 2 * number : 2 * number + 2] = UNKNOWN


def _find_limit_a(current_a: Floats) -> float:
    """Returns the largest current if one joint shows it in many rows: then the drive clipped it."""
    size_a = np.nan_to_num(np.abs(current_a))
    peak_a = float(size_a.max(initial=0.0))
    at_peak = size_a >= CLIP_FRACTION * peak_a
    return peak_a if peak_a > 0.0 and int(at_peak.sum(axis=0).max()) >= CLIPPED_ROWS else math.inf
