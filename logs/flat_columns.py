"""Flattens rows of a log into columns for tables: one number or word per cell, each column with its unit and meaning.

A field with one value per joint or flipper becomes one column for each of them: `angle_rad` becomes
`left_sweep_angle_rad` and so on. Enumerations become words.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control.bounds import Meaning, unit_of
from firmware_host.log.rows import COEFFICIENT_UNIT
from firmware_host.log.schema import Field, RowKind

WALL_CLOCK = "universal time of stamp_s, by the clocks' offset when the log began"


@dataclass(frozen=True)
class Column:
    name: str
    unit: str  # empty for a column without one
    meaning: str
    values: NDArray[Any]
    words: Mapping[int, str]  # of an enumeration, by number; empty for other columns

    def coded(self) -> tuple[NDArray[np.int32], list[str]]:
        """Return the number of each cell's word, and the words. A number that this version does not know is shown."""
        numbers, codes = np.unique(self.values, return_inverse=True)
        return codes.astype(np.int32), [self.words.get(int(number), str(number)) for number in numbers]


def stack_rows(rows: Sequence[Mapping[str, Any]], kind: RowKind) -> NDArray[np.void]:
    """Return decoded rows as a structured array, fields that this version does not know included."""
    missing = {field.name: field.missing for field in kind.fields}
    names = {name: None for row in rows or [missing] for name in row}
    columns = {name: np.array([row[name] for row in rows or [missing]]) for name in names}
    array = np.empty(len(rows), [(name, column.dtype, column.shape[1:]) for name, column in columns.items()])
    for name, column in columns.items():
        array[name] = column[: len(rows)]
    return array


def flat_columns(rows: NDArray[np.void], kind: RowKind, wall_offset_ns: int | None = None) -> list[Column]:
    """Return the columns in the order of the fields; with stamps and the wall clock's offset, `time` comes first."""
    names, time = rows.dtype.names or (), list[Column]()
    if wall_offset_ns is not None and "stamp_s" in names:
        time = [Column("time", "", WALL_CLOCK, _wall_times(rows, wall_offset_ns), {})]
    known = {field.name: field for field in kind.fields}
    return time + [column for name in names for column in _columns_of(known.get(name, Field(name, "")), rows[name])]


def _wall_times(rows: NDArray[np.void], offset_ns: int) -> NDArray[np.datetime64]:
    """Return universal time in nanoseconds; no time for a row without a stamp."""
    known = np.isfinite(rows["stamp_s"])
    stamps_ns = np.round(np.where(known, rows["stamp_s"], 0.0) * 1e9).astype(np.int64)
    return np.where(known, (stamps_ns + offset_ns).astype("datetime64[ns]"), np.datetime64("NaT", "ns"))


def _columns_of(field: Field, values: NDArray[Any]) -> list[Column]:
    unit = COEFFICIENT_UNIT if field.meaning.partition(",")[0] == COEFFICIENT_UNIT else unit_of(field.name, Meaning(""))
    if values.ndim == 1:
        return [Column(field.name, unit, field.meaning, values, dict(enumerate(field.words)))]
    each = field.each or tuple(map(str, range(values.shape[1])))
    names = [f"{name}_{field.name}" if field.each else f"{field.name}_{name}" for name in each]
    everyone = ", ".join(name.replace("_", " ") for name in field.each)  # in the meaning of the whole array
    meanings = [
        field.meaning.replace(everyone, name.replace("_", " ")) if field.each else field.meaning for name in each
    ]
    return [
        Column(name, unit, meaning, values[:, number], {})
        for number, (name, meaning) in enumerate(zip(names, meanings, strict=True))
    ]
