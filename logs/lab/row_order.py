"""Brings rows into the order of their times: rows whose time runs backward are dropped."""

from bisect import bisect_right
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from logs.files.log_error import LogError
from logs.lab.csv_table import TIME, CsvTable
from logs.lab.findings import Finding, FindingKind

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_DROPPED = 0.5  # of the rows; beyond it the times do not order the rows
LONGEST_STEP_S = 0.5  # median time between rows; a stride takes about 1 s


def drop_backward_rows(path: Path, table: CsvTable) -> CsvTable:
    """Keep the longest series of rows whose times do not fall. Raises LogError where the times are of no use."""
    time_s = table.column[TIME]
    kept = longest_ascent(time_s)
    if len(kept) < len(time_s):
        first = int(np.argmax(np.diff(time_s) < 0.0)) + 1
        dropped, back_s = len(time_s) - len(kept), float(time_s[first - 1] - time_s[first])
        text = f"the time runs backward by {back_s:.3f} s; {dropped} of {len(time_s)} rows are dropped"
        found = Finding(FindingKind.TIME, TIME, float(time_s[first]), int(table.line[first]), text)
        if dropped > MOST_DROPPED * len(time_s):
            raise LogError(f"{path}: {found}")
        table.findings.append(found)
    column = {name: values[kept] for name, values in table.column.items()}
    step_s = float(np.median(np.diff(column[TIME]))) if len(kept) > 1 else 0.0
    if step_s > LONGEST_STEP_S:
        raise LogError(f"{path}: column {TIME}: rows are {step_s:g} s apart; times are in seconds")
    return table._replace(column=column, line=table.line[kept])


def longest_ascent(values: Floats) -> Integers:
    """Return the indices of the longest series of values that does not fall (patience sorting)."""
    if np.all(np.diff(values) >= 0.0):
        return np.arange(len(values))
    ends: list[float] = []  # the smallest value that ends an ascent of each length
    places: list[int] = []  # its index
    before = np.full(len(values), -1)
    for index, value in enumerate(values.tolist()):
        length = bisect_right(ends, value)
        before[index] = places[length - 1] if length else -1
        ends[length : length + 1] = [value]
        places[length : length + 1] = [index]
    kept = [places[-1]]
    while before[kept[-1]] >= 0:
        kept.append(int(before[kept[-1]]))
    return np.array(kept[::-1])
