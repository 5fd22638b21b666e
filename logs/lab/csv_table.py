"""Parses the authors' CSV: head lines with the settings, a line of column names, then a row per sample.

The authors publish two head lines, names and then values. This project joined them in one line, "# gait header: names
| values". In some published logs the counts of names and values differ; then no value can be assigned to a name, and
the settings are missing.
"""

import gzip
import math
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from logs.files.expansion import Expansion
from logs.files.log_error import LogError
from logs.lab.findings import Finding, FindingKind, of_whole_log

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

GAIT_HEADER = "# gait header:"
TIME, STATE = "time", "turtle_state"
LONGEST_HEAD = 10  # lines before the column names
TEXT_SETTINGS = ("scenario", "real_time_plot")
USED_SETTINGS = ("lateral_angle_range", "insertion_angle")  # reported as missing where a log has no settings at all
GZIP_MAGIC = b"\x1f\x8b"
NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?|nan|inf(?:inity)?)\s*", re.IGNORECASE)
HELD_S = 0.05  # an empty cell has the value before: a table joined from several messages has a row for each of them
MOST_DROPPED = 0.5  # of the rows; a file of which less is left is not such a log

Cells = list[str]


class CsvTable(NamedTuple):
    """The columns of one file by name, with the line of each row. Rows have a time and a state."""

    column: dict[str, Floats]  # empty cells are NaN
    line: Integers
    gait: dict[str, float]  # settings that are numbers
    missing_settings: tuple[str, ...]
    findings: list[Finding]


def read_table(path: Path, wanted: Sequence[str]) -> CsvTable:
    """Read the time, the state and those of the wanted columns that the file has. Raises LogError."""
    lines = _split_lines(path, unpack(path))
    head = _find_names(path, lines)
    names = [name.strip() for name in lines[head].split(",")]
    numbered = [(number, line) for number, line in enumerate(lines[head + 1 :], head + 2) if line.strip()]
    if not numbered:
        raise LogError(f"{path}: ends at line {head + 1}, which names the columns; there are no rows")
    gait, missing, findings = parse_settings(lines[:head])
    kept = [name for name in names if name in {TIME, STATE, *wanted}]
    if twice := [name for name in kept if kept.count(name) > 1]:
        raise LogError(f"{path}: line {head + 1} names the column {twice[0]} twice")
    places = [names.index(name) for name in kept]
    if _is_torn(numbered[-1][1], len(names), places) and len(numbered) > 1:
        line = numbered.pop()[0]
        text = "the last row is incomplete and is dropped"
        findings.append(Finding(FindingKind.TORN_ROW, "", math.nan, line, text))
    values = _parse_rows(path, numbered, len(names), places)
    line_of_row = np.array([number for number, _ in numbered], dtype=np.int64)
    column = dict(zip(kept, values.T, strict=True))
    return _drop_rows(path, CsvTable(column, line_of_row, gait, missing, findings))


def unpack(path: Path) -> bytes:
    """Return the contents, decompressed if they are compressed; the name does not matter."""
    pieces: list[bytes] = []
    try:
        expansion = Expansion(path, path.stat().st_size)
        with path.open("rb") as file:
            packed = file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
        with gzip.open(path) if packed else path.open("rb") as file:
            while piece := file.read1():
                pieces.append(piece)
                expansion.add(len(piece))
    except (EOFError, zlib.error, gzip.BadGzipFile):
        line = b"".join(pieces).count(b"\n")
        raise LogError(f"{path}: the compressed file breaks off or is damaged after line {line}") from None
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from None
    return b"".join(pieces)


def _split_lines(path: Path, contents: bytes) -> list[str]:
    """Return the lines without their ends, which are those of any system, and without quotation marks."""
    try:
        text = contents.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = contents.count(b"\n", 0, error.start) + 1
        raise LogError(f"{path}: line {line} is not text") from None
    return _with_commas(text.replace("\r\n", "\n").replace("\r", "\n").replace('"', "").split("\n"))


def _with_commas(lines: list[str]) -> list[str]:
    """Separate cells by commas where a spreadsheet used semicolons or tabs, with the comma as decimal sign or not."""
    names = next((line for line in lines[: LONGEST_HEAD + 1] if STATE in line), ",")
    separator = next((each for each in ";\t" if each in names and "," not in names), "")
    return [line.replace(",", ".").replace(separator, ",") for line in lines] if separator else lines


def _find_names(path: Path, lines: list[str]) -> int:
    """Return the index of the line with the column names: the first one that names time and state."""
    for index, line in enumerate(lines[: LONGEST_HEAD + 1]):
        if {TIME, STATE} <= {name.strip() for name in line.split(",")}:
            return index
    raise LogError(f"{path}: none of the first {LONGEST_HEAD + 1} lines names the columns {TIME} and {STATE}")


def parse_settings(head: list[str]) -> tuple[dict[str, float], tuple[str, ...], list[Finding]]:
    """Return the settings that are numbers, the names without one, and what is reported about them."""
    names, values = _split_settings([line for line in head if line.strip(", ")])
    if len(names) != len(values):
        count = f"{len(names)} names and {len(values)} values"
        missing = _without_texts(names)
        text = f"the head has {count} of settings, so no value can be assigned to {', '.join(missing)}"
        return {}, missing, [of_whole_log(FindingKind.MISSING_SETTING, text)]
    if not names:
        text = f"the file has no settings: {', '.join(USED_SETTINGS)} are not known"
        return {}, USED_SETTINGS, [of_whole_log(FindingKind.MISSING_SETTING, text)]
    pairs = dict(zip(names, values, strict=True))
    gait = {name: float(value) for name, value in pairs.items() if _is_number(value) and math.isfinite(float(value))}
    missing = tuple(name for name in _without_texts(names) if name not in gait)
    text = f"the head has no number for {', '.join(missing)}"
    return gait, missing, [of_whole_log(FindingKind.MISSING_SETTING, text)] * bool(missing)


def _split_settings(head: list[str]) -> tuple[Cells, Cells]:
    """Return the names and the values of the settings as they stand in the head; both empty without a head."""
    if len(head) == 1 and head[0].startswith(GAIT_HEADER):
        head = list(head[0].removeprefix(GAIT_HEADER).partition("|")[::2])
    if len(head) != 2:
        return [], []
    names, values = ([cell.strip() for cell in line.split(",")] for line in (head[0].rstrip(", "), head[1]))
    is_padded = head[0].endswith(",")  # by a spreadsheet, which makes all lines as long as the rows
    while values and not values[-1] and (is_padded or len(values) > len(names)):
        values.pop()
    return names, values


def _without_texts(names: Cells) -> tuple[str, ...]:
    return tuple(name for name in names if name not in TEXT_SETTINGS)


def _is_number(text: str) -> bool:
    return NUMBER.fullmatch(text) is not None


def _is_torn(row: str, width: int, places: list[int]) -> bool:
    """Return whether a row breaks off: it has too few cells, or one that is not a number."""
    cells = row.split(",")
    return len(cells) != width or not all(_is_number(cells[place]) or not cells[place].strip() for place in places)


def _parse_rows(path: Path, numbered: list[tuple[int, str]], width: int, places: list[int]) -> Floats:
    rows = [row for _, row in numbered]
    try:
        if any(row.count(",") != width - 1 for row in rows):
            raise ValueError
        return np.loadtxt(rows, delimiter=",", comments=None, ndmin=2, usecols=places)
    except ValueError:
        return np.array([_parse_row(path, line, row.split(","), width, places) for line, row in numbered])


def _parse_row(path: Path, line: int, cells: Cells, width: int, places: list[int]) -> list[float]:
    """Parse a row that may have empty cells, which are NaN. Raises LogError where it is malformed."""
    if len(cells) != width:
        raise LogError(f"{path}: line {line} has {len(cells)} fields, the columns are {width}")
    wanted = [cells[place] for place in places]
    for cell in wanted:
        if cell.strip() and not _is_number(cell):
            raise LogError(f"{path}: line {line}: '{cell}' is not a number")
    return [float(cell) if cell.strip() else math.nan for cell in wanted]


def _drop_rows(path: Path, table: CsvTable) -> CsvTable:
    """Drop the rows without a time or a state, and reports the cells that are empty in the others."""
    known = np.isfinite(table.column[TIME]) & np.isfinite(table.column[STATE])
    if np.count_nonzero(known) < MOST_DROPPED * len(known):
        raise LogError(f"{path}: {np.count_nonzero(~known)} of {len(known)} rows have no time or no {STATE}")
    for name in (TIME, STATE):
        _report_empty(table, name, ~np.isfinite(table.column[name]), FindingKind.ROW_DROPPED)
    for name, values in table.column.items():
        _report_empty(table, name, known & ~np.isfinite(values), FindingKind.EMPTY_CELL)
    column = {name: np.where(np.isfinite(values), values, np.nan)[known] for name, values in table.column.items()}
    return table._replace(column=column, line=table.line[known])


def _report_empty(table: CsvTable, name: str, empty: NDArray[np.bool_], kind: FindingKind) -> None:
    if not np.any(empty):
        return
    rows, first = int(np.count_nonzero(empty)), int(np.argmax(empty))
    held = f"the value before stays for {1e3 * HELD_S:.0f} ms, and then there is none"
    consequence = "dropped" if kind is FindingKind.ROW_DROPPED else held
    text = f"no number in {rows} row{'s' * (rows > 1)}: {consequence}"
    time_s, line = float(table.column[TIME][first]), int(table.line[first])
    table.findings.append(Finding(kind, name, time_s, line, text))
