"""The readings of a stage as a text table: a row for each quantity, a column for each joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from control.records import JOINTS
from experiments.bench.reading import Reading

ROBOT = "robot"  # the column of readings that belong to no joint
HEADS = {ROBOT: ROBOT} | {joint: f"{joint[0]}. {joint.split('_')[1].replace('duction', 'd.')}" for joint in JOINTS}
WHAT, CELL = 46, 11  # characters


class Row(NamedTuple):
    what: str
    unit: str
    bounds: str


def table_lines(heading: str, readings: Sequence[Reading]) -> Iterator[tuple[str, bool]]:
    """Yield each line, and whether its readings are good; yield nothing without readings."""
    rows: dict[Row, dict[str, Reading]] = {}
    for reading in readings:
        column, what = split_name(reading.what)
        rows.setdefault(Row(what, reading.unit, reading.bounds_text), {})[column] = reading
    if rows:
        yield f"{heading:<{WHAT}}{''.join(f'{head:>{CELL}}' for head in HEADS.values())}   must be", True
    for row, cells in rows.items():
        good = all(reading.good for reading in cells.values())
        yield f"{'  ' if good else '! '}{line_of(row, cells)}", good


def split_name(what: str) -> tuple[str, str]:
    """Return the column of a reading, and the rest of its name."""
    joint, _, rest = what.partition(": ")
    return (joint, rest) if joint in JOINTS else (ROBOT, what)


def line_of(row: Row, cells: dict[str, Reading]) -> str:
    texts = "".join(f"{cell_text(cells.get(column)):>{CELL}}" for column in HEADS)
    return f"{row.what:<{WHAT - 2}}{texts}   {row.bounds} {row.unit}".rstrip()


def cell_text(reading: Reading | None) -> str:
    if reading is None:
        return ""
    return reading.number_text if reading.good else f"!{reading.number_text}"
