"""Reads the CSV logs of the paper's authors into this project's conventions, and writes logs as such CSV files.

The authors logged mirrored motors with signs that differ from file to file, for positions and currents separately.
The reader therefore finds the signs from the motion. A flipper moves down in insertion and backward in stance, so its
angles fall there. Its motors do positive work on the mud there, so the current has the sign of the change of angle. A
joint without such a motion keeps its logged signs. The body moves forward in stance.
"""

import gzip
import math
import tomllib
import zlib
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, NoReturn, TextIO

import numpy as np
from numpy.typing import NDArray

from control.records import FLIPPERS, UNKNOWN, Phase
from firmware_host.log_reading.log_reader import Log, LogError, Watch, unwatched

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Truths = NDArray[np.bool_]

GAIT_HEADER = "# gait header:"
JOINT_COLUMNS = ("leftsweeping", "leftadduction", "rightsweeping", "rightadduction")  # in the order of JOINTS
WRITTEN_ORDER = (1, 0, 3, 2)  # the authors put adduction first
BODY_COLUMNS = ("OptitrackPosition_x", "OptitrackPosition_y", "OptitrackPosition_z")
JOINT_SIGNALS = [joint + signal for signal in ("_pos", "_curr") for joint in JOINT_COLUMNS]
REQUIRED_COLUMNS = ("time", "turtle_state", *JOINT_SIGNALS)
FIRST_ROW_LINE = 3
WATCHED_ROWS = 5000  # between two reports of progress

PHASES_BY_STATE = (Phase.REST, Phase.SWING, Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.PAUSE)
STATE_OF_PHASE = {phase: state for state, phase in enumerate(PHASES_BY_STATE)} | {
    Phase.RECOVERY: 5  # the authors have no such state; it is between extraction and swing, as their pauses are
}
PHASE_OF_STATE = {-1: Phase.REST, **dict(enumerate(PHASES_BY_STATE)), **dict.fromkeys((6, 7, 8), Phase.PAUSE)}
PUSHING = (Phase.STANCE, Phase.INSERTION, Phase.STANCE, Phase.INSERTION)  # the phase in which each joint works on mud

CLIP_FRACTION, CLIPPED_ROWS = 0.9995, 200  # half a second of rows at the largest current makes it a limit
BACKWARDS_S = 1.0  # accepted disorder of the rows' times
FROZEN_S, LEAP_M = 0.5, 0.02  # a pose is invalid where it is constant for so long and then changes by so much


class LabLog(NamedTuple):
    """One run: n rows, joints in the order of JOINTS. The joints of an absent flipper are NaN."""

    stamp_s: Floats
    phase: Integers  # of control.records.Phase
    angle_rad: Floats  # (n, 4)
    current_a: Floats  # (n, 4)
    body_x_m: Floats  # NaN where motion capture did not see the body
    gait: dict[str, float]  # the operator's settings; `insertion_angle` is the commanded depth in m
    flippers: tuple[str, ...]  # the ones that moved
    current_limit_a: float  # at which the drives clipped; infinite where they did not


def read_lab_csv(path: Path) -> LabLog:
    """Reads a `.csv` or `.csv.gz`: settings, column names, then a row per sample. Raises LogError."""
    lines = _read_lines(path)
    gait = _parse_gait(path, lines[0])
    names = _parse_names(path, lines[1])
    column = dict(zip(names, _parse_rows(path, lines[2:], len(names)).T, strict=True))
    stamp_s = _check_time(path, column["time"])
    phase = _read_phases(path, column["turtle_state"])
    angle_rad = math.tau * np.column_stack([column[f"{joint}_pos"] for joint in JOINT_COLUMNS])
    current_a = np.column_stack([column[f"{joint}_curr"] for joint in JOINT_COLUMNS])
    flippers = _find_flippers(angle_rad)
    _blank_absent(angle_rad, current_a, flippers)
    _orient(angle_rad, current_a, phase)
    body_x_m = _body_advance([column[name] for name in BODY_COLUMNS if name in column], stamp_s, phase)
    return LabLog(stamp_s, phase, angle_rad, current_a, body_x_m, gait, flippers, _find_limit_a(current_a))


def _read_lines(path: Path) -> list[str]:
    """Returns the lines of the file, at least the two of the head and one row."""
    contents = _unpack(path)
    try:
        lines = contents.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        line = contents.count(b"\n", 0, error.start) + 1
        raise LogError(f"{path}: line {line} is not text") from None
    while lines and not lines[-1].strip():
        lines.pop()
    if len(lines) < FIRST_ROW_LINE:
        raise LogError(f"{path}: ends at line {len(lines)}; the rows begin at line {FIRST_ROW_LINE}")
    return lines


def _unpack(path: Path) -> bytes:
    pieces: list[bytes] = []
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            while piece := file.read1():
                pieces.append(piece)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        line = b"".join(pieces).count(b"\n")
        raise LogError(f"{path}: the compressed file breaks off or is damaged after line {line}") from None
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from None
    return b"".join(pieces)


def _parse_gait(path: Path, line: str) -> dict[str, float]:
    """Returns the operator's settings that are numbers."""
    names, bar, values = line.removeprefix(GAIT_HEADER).partition("|")
    settings = list(zip(names.split(","), values.split(","), strict=False))
    if not line.startswith(GAIT_HEADER) or not bar or names.count(",") != values.count(","):
        raise LogError(f"{path}: line 1 is not '{GAIT_HEADER} names | values', with as many values as names")
    return {name.strip(): float(value) for name, value in settings if _is_number(value)}


def _parse_names(path: Path, line: str) -> list[str]:
    names = [name.strip() for name in line.split(",")]
    missing = [name for name in REQUIRED_COLUMNS if name not in names]
    if missing:
        raise LogError(f"{path}: line 2 names no column {', '.join(missing)}")
    return names


def _parse_rows(path: Path, rows: list[str], width: int) -> Floats:
    table: Floats = np.empty(0)
    with suppress(ValueError):
        table = np.loadtxt(rows, delimiter=",", comments=None, ndmin=2)
    if table.shape != (len(rows), width):
        _refuse_rows(path, rows, width)
    return table


def _refuse_rows(path: Path, rows: list[str], width: int) -> NoReturn:
    """Reads the rows again, one by one, to name the first malformed one."""
    for line, row in enumerate(rows, FIRST_ROW_LINE):
        fields = row.split(",")
        if len(fields) != width:
            raise LogError(f"{path}: line {line} has {len(fields)} fields, line 2 names {width}")
        for field in fields:
            if not _is_number(field):
                raise LogError(f"{path}: line {line}: '{field}' is not a number")
    raise LogError(f"{path}: the rows from line {FIRST_ROW_LINE} on are not a table of numbers")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _check_time(path: Path, stamp_s: Floats) -> Floats:
    _refuse_where(~np.isfinite(stamp_s), path, "has no time")
    back_s = np.maximum.accumulate(stamp_s) - stamp_s
    _refuse_where(back_s > BACKWARDS_S, path, f"goes back in time by more than {BACKWARDS_S:g} s")
    return stamp_s


def _read_phases(path: Path, state: Floats) -> Integers:
    _refuse_where(~np.isin(state, list(PHASE_OF_STATE)), path, "has a turtle_state that is not known")
    phase_from_lowest = np.array([PHASE_OF_STATE[known] for known in sorted(PHASE_OF_STATE)], dtype=np.int64)
    return phase_from_lowest[state.astype(np.int64) - min(PHASE_OF_STATE)]


def _refuse_where(wrong: Truths, path: Path, reason: str) -> None:
    if np.any(wrong):
        raise LogError(f"{path}: line {int(np.argmax(wrong)) + FIRST_ROW_LINE} {reason}")


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


def _orient(angle_rad: Floats, current_a: Floats, phase: Integers) -> None:
    """Inverts a joint's angle unless it falls while pushing, then its current unless that does positive work."""
    for joint, pushing in enumerate(PUSHING):
        inside = _steps_inside(phase, pushing)
        if np.nansum(np.diff(angle_rad[:, joint])[inside]) > 0.0:
            angle_rad[:, joint] *= -1.0
        mean_current_a = (current_a[1:, joint] + current_a[:-1, joint]) / 2.0
        if np.nansum((mean_current_a * np.diff(angle_rad[:, joint]))[inside]) < 0.0:
            current_a[:, joint] *= -1.0


def _steps_inside(phase: Integers, wanted: Phase) -> Truths:
    """Returns which steps from one row to the next begin and end in a phase."""
    inside: Truths = (phase[1:] == wanted) & (phase[:-1] == wanted)
    return inside


def _body_advance(position_columns_m: list[Floats], stamp_s: Floats, phase: Integers) -> Floats:
    """Returns the body's position along the direction in which the stances moved it.

    The first principal axis would be wrong: in two of the authors' walks the body heaves as far as it advances.
    """
    if not position_columns_m:
        return np.full(len(stamp_s), UNKNOWN)
    position_m = np.column_stack(position_columns_m)
    position_m[_is_lost(position_m, stamp_s)] = UNKNOWN
    stance_m = np.nansum(np.diff(position_m, axis=0)[_steps_inside(phase, Phase.STANCE)], axis=0)
    distance_m = float(np.linalg.norm(stance_m))
    if distance_m == 0.0:
        return np.full(len(stamp_s), UNKNOWN)
    advance_m: Floats = position_m @ (stance_m / distance_m)
    return advance_m


def _is_lost(position_m: Floats, stamp_s: Floats) -> Truths:
    """Returns the rows with an invalid pose: frozen until it leaps to the true one, or three zeros."""
    is_new = np.any(np.diff(position_m, axis=0, prepend=UNKNOWN) != 0.0, axis=1)
    first = np.flatnonzero(is_new)
    rows = np.diff(first, append=len(stamp_s))  # number of rows with each pose
    held_s = stamp_s[first + rows - 1] - stamp_s[first]
    leap_m = np.append(np.linalg.norm(np.diff(position_m[first], axis=0), axis=1), 0.0)
    lost: Truths = np.repeat((held_s > FROZEN_S) & (leap_m > LEAP_M), rows)
    if position_m.shape[1] == len(BODY_COLUMNS):
        lost[np.all(position_m == 0.0, axis=1)] = True
    return lost


def write_lab_csv(log: Log, out: TextIO, watch: Watch = unwatched) -> None:
    """Writes the authors' columns and units, with the configured gait and the first stride's depth as settings."""
    settings = _settings(log)
    out.write(f"{GAIT_HEADER} {','.join(settings)} | {','.join(settings.values())}\n")
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
        columns[f"{JOINT_COLUMNS[joint]}_pos"] = log.ticks["angle_rad"][:, joint] / math.tau
    for joint in WRITTEN_ORDER:
        columns[f"{JOINT_COLUMNS[joint]}_curr"] = log.ticks["current_a"][:, joint]
    if np.any(np.isfinite(log.ticks["body_x_m"])):
        columns[BODY_COLUMNS[0]] = log.ticks["body_x_m"]
    return columns
