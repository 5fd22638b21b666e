"""Writes a log as Parquet files: one for the ticks, one for the strides, one for the events.

Unit and meaning of a column are metadata of its field (`unit`, `meaning`); the log's metadata and its configuration are
metadata of the file. This module needs the extra `data`.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from firmware_host.log.log_file import ATTACHMENT
from firmware_host.log.rows import EVENT, STRIDE, tick_kind
from firmware_host.log.schema import RowKind
from firmware_host.log.whole_files import whole_files
from firmware_host.log_reading.log_reader import Log, Watch, unwatched
from firmware_host.open_data.flat_columns import Column, flat_columns, stack_rows


class _Part(NamedTuple):
    name: str
    rows: NDArray[np.void]
    kind: RowKind


def write_parquet(log: Log, folder: Path, stem: str, watch: Watch = unwatched) -> list[Path]:
    """Writes STEM-ticks.parquet, STEM-strides.parquet and STEM-events.parquet: all, or none. Raises OSError."""
    parts = [
        _Part("ticks", log.ticks, tick_kind(log.rig)),
        _Part("strides", stack_rows(log.strides, STRIDE), STRIDE),
        _Part("events", stack_rows(log.events, EVENT), EVENT),
    ]
    paths = [folder / f"{stem}-{part.name}.parquet" for part in parts]
    metadata = log.metadata | {ATTACHMENT: log.configuration_text, "complete": str(log.complete).lower()}
    with whole_files(paths) as hidden:
        for number, (part, path) in enumerate(zip(parts, hidden, strict=True)):
            watch("tables written", number, len(parts))
            pq.write_table(arrow_table(flat_columns(part.rows, part.kind), metadata), path, compression="zstd")
    return paths


def arrow_table(columns: list[Column], metadata: dict[str, str]) -> pa.Table:
    arrays = [_array_of(column) for column in columns]
    fields = [
        pa.field(column.name, array.type, metadata={"unit": column.unit, "meaning": column.meaning})
        for column, array in zip(columns, arrays, strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields, metadata=metadata))


def _array_of(column: Column) -> pa.Array:
    if column.words:
        codes, words = column.coded()
        return pa.DictionaryArray.from_arrays(codes, pa.array(words, pa.string()))
    return pa.array(np.ascontiguousarray(column.values))
