"""One entry of the catalogue: what a closed log contains, or why it cannot be read."""

from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple


class MudEntry(NamedTuple):
    """A mud that the robot felt, in the order of the walk; the log's event "another mud" separates two."""

    strides: int
    k_p: float | None  # N/m³, as the other two: medians of the valid ones
    k_s: float | None
    k_e: float | None
    speed_m_s: float | None


class LogEntry(NamedTuple):
    """The columns of the catalogue; COLUMNS has their types. Values that are not known are None."""

    file: str
    state: str
    reason: str
    bytes: int
    changed_ns: int
    run: str = ""
    segment: int | None = None
    robot: str = ""
    started: datetime | None = None
    duration_s: float | None = None
    walks: int | None = None
    strides: int | None = None
    stuck_strides: int | None = None
    distance_m: float | None = None
    speed_m_s: float | None = None
    muds: tuple[MudEntry, ...] = ()
    faults: tuple[str, ...] = ()
    recovered: bool = False
    configuration_sha256: str = ""
    version: str = ""
    commit: str = ""


MUDS = "STRUCT(strides INTEGER, k_p DOUBLE, k_s DOUBLE, k_e DOUBLE, speed_m_s DOUBLE)[]"
SQL_TYPES: dict[Any, str] = {
    str: "VARCHAR",
    int: "BIGINT",
    int | None: "INTEGER",
    float | None: "DOUBLE",
    datetime | None: "TIMESTAMP",
    bool: "BOOLEAN",
    tuple[MudEntry, ...]: MUDS,
    tuple[str, ...]: "VARCHAR[]",
}
COLUMNS = {name: SQL_TYPES[kind] for name, kind in LogEntry.__annotations__.items()}  # name -> type in SQL


TRIALS = "trials.parquet"  # the results of a campaign, which have the same columns and more


class FileStamp(NamedTuple):
    """A file with the same stamp has the same contents, wherever it was moved to."""

    name: str
    bytes: int
    changed_ns: int


def stamp_of(path: Path) -> FileStamp:
    """Raises OSError."""
    status = path.stat()
    return FileStamp(path.name, status.st_size, status.st_mtime_ns)


def stamp_of_entry(entry: LogEntry) -> FileStamp:
    return FileStamp(entry.file.rpartition("/")[2], entry.bytes, entry.changed_ns)


def entry_of_row(row: tuple[Any, ...]) -> LogEntry:
    """Return the entry of a row of the table."""
    values = dict(zip(COLUMNS, row, strict=True))
    values["muds"] = tuple(MudEntry(**mud) for mud in values["muds"])
    values["faults"] = tuple(values["faults"])
    return LogEntry(**values)


def row_of_entry(entry: LogEntry) -> tuple[Any, ...]:
    values = entry._asdict() | {"muds": [mud._asdict() for mud in entry.muds], "faults": list(entry.faults)}
    return tuple(values[name] for name in COLUMNS)
