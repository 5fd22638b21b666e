"""Writes a log as Parquet files: one for the ticks, one for the strides, one for the events.

Unit and meaning of a column are metadata of its field (`unit`, `meaning`); the log's metadata and its configuration are
metadata of the file. This module needs the extra `data`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from firmware_host.log.log_file import ATTACHMENT
from firmware_host.log.rows import EVENT, STRIDE, tick_kind
from logs.files.log_error import Watch, unwatched
from logs.files.log_reader import AnyLog, TickPass
from logs.files.log_summary import wall_offset_ns
from logs.files.tick_array import in_groups
from logs.files.whole_files import whole_files
from logs.flat_columns import Column, flat_columns, stack_rows

NO_NUMBERS: Mapping[str, NDArray[Any]] = {}
ROWS_PER_GROUP = 1 << 14  # of a table: six megabytes of ticks, of which the writer needs several copies


def write_parquet(log: AnyLog, folder: Path, stem: str, watch: Watch = unwatched) -> list[Path]:
    """Write STEM-ticks.parquet, STEM-strides.parquet and STEM-events.parquet: all, or none.

    The metadata, which say whether the log is complete, come before the rows: a log that is cut off meanwhile is
    written again. Raises OSError, and LogError: LogCutError after the rows before the cut.
    """
    paths = [folder / f"{stem}-{name}.parquet" for name in ("ticks", "strides", "events")]
    metadata = log.metadata | {ATTACHMENT: log.configuration_text}
    with whole_files(paths) as hidden:
        ticks = _write_tables(log, hidden, metadata, log.complete, watch)
        if ticks.complete != log.complete:
            ticks = _write_tables(log, hidden, metadata, False, watch)
    ticks.raise_cut()
    return paths


def _write_tables(log: AnyLog, paths: list[Path], metadata: dict[str, str], complete: bool, watch: Watch) -> TickPass:
    """Return the pass over the ticks, which knows whether they were cut off meanwhile."""
    metadata, offset_ns = metadata | {"complete": str(complete).lower()}, wall_offset_ns(log.metadata)
    for path, rows, kind in zip(paths[1:], (log.strides, log.events), (STRIDE, EVENT), strict=True):
        table = arrow_table(flat_columns(stack_rows(rows, kind), kind, offset_ns), metadata)
        pq.write_table(table, path, compression="zstd")
    kind, numbers = tick_kind(log.rig), _enumerated(log)
    empty = arrow_table(flat_columns(log.ends[:0], kind, offset_ns), metadata, numbers)
    ticks = TickPass(log, watch, "rows written")
    with pq.ParquetWriter(paths[0], empty.schema, compression="zstd") as writer:
        writer.write_table(empty)
        for rows_of_group in in_groups(ticks, ROWS_PER_GROUP):
            writer.write_table(arrow_table(flat_columns(rows_of_group, kind, offset_ns), metadata, numbers))
    return ticks


def _enumerated(log: AnyLog) -> dict[str, NDArray[Any]]:
    """Return the numbers that occur in each enumeration of a tick, in ascending order."""
    found: dict[str, set[int]] = {}
    for ticks in TickPass(log, unwatched, ""):
        for column in flat_columns(ticks, tick_kind(log.rig)):
            if column.words:
                found.setdefault(column.name, set()).update(np.unique(column.values).tolist())
    return {name: np.array(sorted(numbers)) for name, numbers in found.items()}


def arrow_table(
    columns: list[Column], metadata: dict[str, str], numbers: Mapping[str, NDArray[Any]] = NO_NUMBERS
) -> pa.Table:
    """`numbers` are those of the enumerations in all tables of a file."""
    arrays = [_array_of(column, numbers.get(column.name)) for column in columns]
    fields = [
        pa.field(column.name, array.type, metadata={"unit": column.unit, "meaning": column.meaning})
        for column, array in zip(columns, arrays, strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields, metadata=metadata))


def _array_of(column: Column, numbers: NDArray[Any] | None) -> pa.Array:
    if column.words:
        codes, words = column.coded(numbers)
        return pa.DictionaryArray.from_arrays(codes, pa.array(words, pa.string()))
    is_time = column.values.dtype.kind == "M"
    return pa.array(np.ascontiguousarray(column.values), pa.timestamp("ns", tz="UTC") if is_time else None)
