"""Reads the CSV logs of the paper's authors into this project's conventions.

The authors logged mirrored motors with signs that differ from file to file, so `lab.joint_signs` finds them. What the
reader notices is in `findings`: rows that it drops, samples that it invalidates, and facts that the reader of a report
must know. A log in which every number would be wrong is refused.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.geometry import FlipperGeometry
from control.records import FLIPPERS, UNKNOWN, Phase
from firmware_host.configuration.configuration import CaptureAxis
from logs.files.log_error import LogError
from logs.lab.body_track import VERTICAL_AXIS, read_body_track
from logs.lab.columns import (
    BACKWARD,
    CURRENT_COLUMNS,
    DEPTH_COLUMN,
    PHASE_OF_STATE,
    POSITION_COLUMNS,
    READ_COLUMNS,
)
from logs.lab.csv_table import HELD_S, STATE, TIME, CsvTable, read_table
from logs.lab.findings import Finding, FindingKind, of_whole_log
from logs.lab.joint_signs import orient
from logs.lab.log_rows import LogRows, known_range
from logs.lab.row_order import drop_backward_rows
from logs.lab.signal_checks import AT_PEAK, CLEAR_TRAVEL_RAD, check_ranges, check_swapped_joints, drop_stuck_signals
from logs.lab.zero_checks import check_zero

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Truths = NDArray[np.bool_]

FLIPPER_COLUMNS = {
    flipper: (*POSITION_COLUMNS[2 * number : 2 * number + 2], *CURRENT_COLUMNS[2 * number : 2 * number + 2])
    for number, flipper in enumerate(FLIPPERS)
}
AUTHORS_GEOMETRY = FlipperGeometry()
CLIPPED_S = 0.5  # at the largest current make it a limit
STILL_M = 0.005  # by which a captured bench moves at most
MOST_UNKNOWN = 0.5  # of the rows' states; beyond it this is another column


class LabLog(NamedTuple):
    """One run: n rows, joints in the order of JOINTS. The joints of an absent flipper are NaN."""

    stamp_s: Floats
    phase: Integers  # of control.records.Phase
    angle_rad: Floats  # (n, 4)
    current_a: Floats  # (n, 4)
    body_x_m: Floats  # along the horizontal direction of the stances; NaN where motion capture did not see the body
    gait: dict[str, float]  # the operator's settings; `insertion_angle` is the commanded depth in m
    flippers: tuple[str, ...]  # the ones that moved
    current_limit_a: float  # at which the drives clipped; infinite where they did not
    commanded_depth_m: Floats  # NaN where the log does not have it
    body_height_m: Floats  # above the origin of the capture; NaN where unknown
    body_pitch_rad: Floats  # of the nose upward, since the first known pose; NaN where unknown
    missing_settings: tuple[str, ...] = ()  # that the head names without a value
    findings: tuple[Finding, ...] = ()

    @property
    def fixed_base(self) -> bool:
        """Whether a single flipper moved and no body with it: it was mounted on a bench."""
        return len(self.flippers) == 1 and not known_range(self.body_x_m) > STILL_M


def log_name(path: Path) -> str:
    """Return a log's file name without its ending, also that of an MCAP file."""
    return path.name.removesuffix(".gz").removesuffix(".csv").removesuffix(".mcap")


def is_lab_csv(path: Path) -> bool:
    """Return whether a file's name is that of a CSV, compressed or not."""
    return path.name.endswith((".csv", ".csv.gz"))


def read_lab_csv(
    path: Path, vertical: CaptureAxis = VERTICAL_AXIS, geometry: FlipperGeometry = AUTHORS_GEOMETRY
) -> LabLog:
    """Read a CSV file, plain or gzip, and check its zero by the geometry of its robot. Raises LogError.

    `vertical` is the axis of the capture that points up.
    """
    table = _hold(drop_backward_rows(path, read_table(path, READ_COLUMNS)))
    _refuse_missing(path, table)
    rows = LogRows(path, table.column[TIME], table.line, _read_phases(path, table), table.findings)
    angle_rad, current_a = math.tau * _stack(table, POSITION_COLUMNS), _stack(table, CURRENT_COLUMNS)
    joint_moved = known_range(angle_rad) > CLEAR_TRAVEL_RAD
    moved = {name: bool(joint_moved[2 * number : 2 * number + 2].any()) for number, name in enumerate(FLIPPERS)}
    _report_missing(table, moved)
    absent = np.repeat([not moved[name] for name in FLIPPERS], 2)
    angle_rad[:, absent] = current_a[:, absent] = UNKNOWN  # the authors log zeros for absent motors
    commanded_m = table.column.get(DEPTH_COLUMN, np.full(len(table.line), table.gait.get("insertion_angle", UNKNOWN)))
    current_limit_a = _find_limit_a(rows.time_s, current_a)
    check_ranges(rows, angle_rad, current_a)
    check_swapped_joints(rows, angle_rad)
    drop_stuck_signals(rows, angle_rad, current_a)
    orient(rows, angle_rad, current_a)
    check_zero(rows, geometry, angle_rad, commanded_m, table.gait.get("extraction_height", UNKNOWN))
    track = read_body_track(rows, table, vertical)
    if table.gait.get(BACKWARD, 0.0) > 0.0:  # all signs above are those of a walk forward
        angle_rad[:, ::2] *= -1.0
        current_a[:, ::2] *= -1.0
        track = track._replace(advance_m=-track.advance_m, pitch_rad=-track.pitch_rad)
    return LabLog(
        stamp_s=rows.time_s,
        phase=rows.phase,
        angle_rad=angle_rad,
        current_a=current_a,
        body_x_m=track.advance_m,
        gait=table.gait,
        flippers=tuple(name for name in FLIPPERS if moved[name]),
        current_limit_a=current_limit_a,
        commanded_depth_m=commanded_m,
        body_height_m=track.height_m,
        body_pitch_rad=track.pitch_rad,
        missing_settings=table.missing_settings,
        findings=tuple(rows.findings),
    )


def _hold(table: CsvTable) -> CsvTable:
    """Keep each value through the empty cells of the next HELD_S."""
    time_s, rows = table.column[TIME], np.arange(len(table.line))
    column = {}
    for name, values in table.column.items():
        last = np.maximum.accumulate(np.where(np.isnan(values), 0, rows))
        column[name] = np.where(time_s - time_s[last] < HELD_S, values[last], values)
    return table._replace(column=column)


def _refuse_missing(path: Path, table: CsvTable) -> None:
    """Refuse a file without the positions and currents of at least one flipper. Raises LogError."""
    if not any(set(names) <= table.column.keys() for names in FLIPPER_COLUMNS.values()):
        missing = ", ".join(name for names in FLIPPER_COLUMNS.values() for name in names if name not in table.column)
        raise LogError(f"{path}: there is no column {missing}; positions and currents of one flipper are needed")


def _report_missing(table: CsvTable, moved: dict[str, bool]) -> None:
    for flipper, names in FLIPPER_COLUMNS.items():
        missing = ", ".join(name for name in names if name not in table.column)
        if missing and moved[flipper]:
            text = f"there is no column {missing}, so the {flipper} flipper has no coefficients"
            table.findings.append(of_whole_log(FindingKind.EMPTY_CELL, text))


def _stack(table: CsvTable, names: tuple[str, ...]) -> Floats:
    """Return the columns side by side, NaN for those that the file does not have."""
    absent = np.full(len(table.line), np.nan)
    return np.column_stack([table.column.get(name, absent) for name in names])


def _read_phases(path: Path, table: CsvTable) -> Integers:
    """Return the phase of each row; a state that is not known is a pause. Raises LogError where most are unknown."""
    state = table.column[STATE]
    known = np.isin(state, list(PHASE_OF_STATE))
    phase_from_lowest = np.array([PHASE_OF_STATE[number] for number in sorted(PHASE_OF_STATE)], dtype=np.int64)
    phase = np.full(len(state), Phase.PAUSE, dtype=np.int64)
    phase[known] = phase_from_lowest[state[known].astype(np.int64) - min(PHASE_OF_STATE)]
    if not np.all(known):
        _report_unknown(path, table, known)
    return phase


def _report_unknown(path: Path, table: CsvTable, known: NDArray[np.bool_]) -> None:
    first, count = int(np.argmin(known)), int(np.count_nonzero(~known))
    others = f"{count} of {len(known)} rows have such a state and count as a pause"
    text = f"the state {table.column[STATE][first]:g} is not known; {others}"
    found = Finding(FindingKind.UNKNOWN_STATE, STATE, float(table.column[TIME][first]), int(table.line[first]), text)
    if count > MOST_UNKNOWN * len(known):
        raise LogError(f"{path}: {found}")
    table.findings.append(found)


def _find_limit_a(time_s: Floats, current_a: Floats) -> float:
    """Return the largest current if one joint shows it for CLIPPED_S: then the drive clipped it."""
    size_a = np.nan_to_num(np.abs(current_a))
    peak_a = float(size_a.max(initial=0.0))
    at_peak = size_a >= AT_PEAK * peak_a
    clipped_s = np.diff(time_s) @ (at_peak[1:] & at_peak[:-1])
    return peak_a if peak_a > 0.0 and float(clipped_s.max()) >= CLIPPED_S else math.inf
