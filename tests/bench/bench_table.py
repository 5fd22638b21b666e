"""The readings of a stage as a text table: a row for each quantity, a column for each joint."""

from collections.abc import Iterator, Sequence

from control.records import JOINTS
from experiments.bench.reading import BenchReading
from experiments.reports.text_tables import table

ROBOT = "robot"  # the column of readings that belong to no joint
HEADS = {ROBOT: ROBOT} | {joint: f"{joint[0]}. {joint.split('_')[1].replace('duction', 'd.')}" for joint in JOINTS}


def table_lines(heading: str, readings: Sequence[BenchReading]) -> Iterator[tuple[str, bool]]:
    """Yield each line, and whether its readings are good; yield nothing without readings."""
    by_row: dict[tuple[str, str], dict[str, BenchReading]] = {}
    for reading in readings:
        joint, _, rest = reading.what.partition(": ")
        column, what = (joint, rest) if joint in JOINTS else (ROBOT, reading.what)
        by_row.setdefault((what, f"{reading.bounds_text} {reading.unit}"), {})[column] = reading
    rows, all_good = [[heading, *HEADS.values(), "must be"]], [True]
    for (what, bounds), cells in by_row.items():
        good = {column: reading.good for column, reading in cells.items()}
        texts = {column: f"{'' if good[column] else '!'}{reading.number_text}" for column, reading in cells.items()}
        all_good.append(all(good.values()))
        rows.append([f"{'  ' if all_good[-1] else '! '}{what}", *(texts.get(column, "") for column in HEADS), bounds])
    if by_row:
        yield from zip(table(rows).splitlines(), all_good, strict=True)
