"""Writes the trials of a campaign as one Parquet file, which the catalogue of logs reads as its table `trials`.

A row has the catalogue's columns, the number of its point, its seed, the digest of the sources that computed it, and a
column for each key that differs between the points: world_segment_strength_pa for world.segment.strength_pa. This
module needs the extra `data`.
"""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from logs.catalogue.entry import COLUMNS, MUDS
from logs.files.whole_files import whole_file

MUD = [("strides", pa.int32()), *((name, pa.float64()) for name in ("k_p", "k_s", "k_e", "speed_m_s"))]
ARROW_TYPES = {
    "VARCHAR": pa.string(), "BIGINT": pa.int64(), "INTEGER": pa.int32(), "DOUBLE": pa.float64(),
    "TIMESTAMP": pa.timestamp("us"), "BOOLEAN": pa.bool_(), "VARCHAR[]": pa.list_(pa.string()),
    MUDS: pa.list_(pa.struct(MUD)),
}  # fmt: skip
OWN = {"point": "INTEGER", "seed": "INTEGER", "sources": "VARCHAR"}


def write_trials(path: Path, rows: Sequence[Mapping[str, Any]], keys: Sequence[str], metadata: dict[str, str]) -> None:
    """`rows` have the catalogue's columns, `point`, `seed`, `sources` and the values by key. Raises OSError."""
    known = pa.schema([(name, ARROW_TYPES[kind]) for name, kind in (COLUMNS | OWN).items()])
    table = pa.Table.from_pylist(rows, known)
    for key in keys:
        table = table.append_column(key.replace(".", "_"), _varied([row[key] for row in rows]))
    with whole_file(path) as hidden:
        pq.write_table(table.replace_schema_metadata(metadata), hidden, compression="zstd")


def _varied(values: Sequence[Any]) -> pa.Array:
    """Return numbers, words or truth values as they are, and any other value, or a mixture of them, as JSON."""
    if all(isinstance(value, int | float | str) for value in values):
        with suppress(pa.ArrowInvalid, pa.ArrowTypeError):
            return pa.array(values)
    return pa.array([json.dumps(value) for value in values], pa.string())
