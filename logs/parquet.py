"""Writes a log as Parquet files: one for the ticks, one for the strides, one for the events.

Unit and meaning of a column are metadata of its field (`unit`, `meaning`); the log's metadata and its configuration are
metadata of the file, by which pandas makes `time` the index. This module needs the extra `data`.
"""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from firmware_host.log.log_file import ATTACHMENT
from firmware_host.log.rows import EVENT, STRIDE, tick_kind
from logs.files.log_error import Watch, unwatched
from logs.files.log_reader import AnyLog, watched_blocks
from logs.files.log_summary import wall_offset_ns
from logs.files.tick_array import in_groups
from logs.files.whole_files import whole_files
from logs.flat_columns import Column, flat_columns, stack_rows

ROWS_PER_GROUP = 1 << 14  # of a table: seven megabytes of ticks, of which the writer needs several copies
TIME_INDEX = {  # as pandas writes it: https://pandas.pydata.org/docs/development/developer.html
    "index_columns": ["time"],
    "column_indexes": [],
    "columns": [
        {
            "name": "time",
            "field_name": "time",
            "pandas_type": "datetimetz",
            "numpy_type": "datetime64[ns]",
            "metadata": {"timezone": "UTC"},
        }
    ],
}


def write_parquet(log: AnyLog, folder: Path, stem: str, watch: Watch = unwatched) -> list[Path]:
    """Write STEM-ticks.parquet, STEM-strides.parquet and STEM-events.parquet: all, or none.

    Raises OSError and LogError.
    """
    paths = [folder / f"{stem}-{name}.parquet" for name in ("ticks", "strides", "events")]
    metadata = log.metadata | {ATTACHMENT: log.configuration_text, "complete": str(log.complete).lower()}
    ticks, offset_ns = tick_kind(log.rig), wall_offset_ns(log.metadata)
    with whole_files(paths) as hidden:
        for path, rows, kind in zip(hidden[1:], (log.strides, log.events), (STRIDE, EVENT), strict=True):
            table = _arrow_table(flat_columns(stack_rows(rows, kind), kind, offset_ns), metadata)
            pq.write_table(table, path, compression="zstd")
        schema = _arrow_table(flat_columns(log.ends[:0], ticks, offset_ns), metadata).schema
        with pq.ParquetWriter(hidden[0], schema, compression="zstd") as writer:
            for group in in_groups(watched_blocks(log, watch, "rows written"), ROWS_PER_GROUP):
                writer.write_table(_arrow_table(flat_columns(group, ticks, offset_ns), metadata))
    return paths


def _arrow_table(columns: list[Column], metadata: dict[str, str]) -> pa.Table:
    arrays = [_arrow_array(column) for column in columns]
    fields = [
        pa.field(column.name, array.type, metadata={"unit": column.unit, "meaning": column.meaning})
        for column, array in zip(columns, arrays, strict=True)
    ]
    if any(column.name == "time" for column in columns):  # the offset of both clocks is known
        metadata = metadata | {"pandas": json.dumps(TIME_INDEX)}
    return pa.table(arrays, schema=pa.schema(fields, metadata=metadata))


def _arrow_array(column: Column) -> pa.Array:
    if column.words:
        codes, words = column.coded()
        return pa.DictionaryArray.from_arrays(codes, pa.array(words, pa.string()))
    is_time = column.values.dtype.kind == "M"
    return pa.array(np.ascontiguousarray(column.values), pa.timestamp("ns", tz="UTC") if is_time else None)
