"""One entry of the catalogue: what a closed log contains, or why it cannot be read."""

from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple


class MudEntry(NamedTuple):
    """A mud that the robot felt in one walk; the log's event "another mud" separates two."""

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
    mud: str = ""  # this and the next six: the description of the trial
    water: float | None = None  # %
    trial: str = ""
    operator: str = ""
    tags: tuple[str, ...] = ()
    note: str = ""
    more: str = "{}"  # its other keys, as JSON
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
    values |= {name: tuple(values[name]) for name in ("faults", "tags")}
    return LogEntry(**values)


def row_of_entry(entry: LogEntry) -> tuple[Any, ...]:
    return tuple(values_of_entry(entry).values())


def values_of_entry(entry: LogEntry) -> dict[str, Any]:
    """Return the values by column, as SQL and JSON have them."""
    lists = {"faults": list(entry.faults), "tags": list(entry.tags)}
    return entry._asdict() | {"muds": [mud._asdict() for mud in entry.muds]} | lists
