"""Logs as numpy arrays, and their replay."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.mud import Method
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.rows import EVENT, STRIDE
from firmware_host.log.schema import RowKind
from firmware_host.log_reading.log_reader import read_logs
from firmware_host.log_reading.replay import Replay, configuration_of, replay_files

Rows = NDArray[np.void]  # a structured array: rows["stamp_s"] is the column of that field
Paths = str | Path | Sequence[str | Path]


@dataclass(frozen=True)
class OpenedLog:
    """One log, or the joined segments of one run. Field names end with the unit; docs/reference/log.md lists them."""

    paths: tuple[Path, ...]
    ticks: Rows  # one row per tick; arrays over joints in the order left sweep, left adduction, right sweep, ...
    strides: Rows  # one row per closed stride of a flipper
    events: Rows  # changes of mode, faults and requests
    metadata: dict[str, str]  # robot, run_id, version, commit, ...
    configuration_text: str  # the TOML file with which the daemon ran
    complete: bool  # False where the writer was cut off
    unknown_fields: tuple[str, ...]  # of a later version; they are in the arrays too
    missing_fields: tuple[str, ...]  # of an earlier version; they are NaN, 0, False or empty

    @property
    def configuration(self) -> Configuration:
        """The configuration with which the daemon ran. Raises LogError where this version does not accept it."""
        return configuration_of(self.paths[0], self.configuration_text)


def open_log(path: Paths) -> OpenedLog:
    """Reads an MCAP log, or several segments of one run. Raises LogError."""
    paths = _as_paths(path)
    log = read_logs(paths)
    arrays = {"strides": _as_array(log.strides, STRIDE), "events": _as_array(log.events, EVENT)}
    return OpenedLog(paths=paths, **(log._asdict() | arrays))


def replay(path: Paths, method: Method | None = None, configuration: Configuration | None = None) -> Replay:
    """Estimates the mud from a log again: an MCAP log, its segments, or the authors' CSV. Raises LogError.

    `method` and `configuration` replace those of the log.
    """
    return replay_files(_as_paths(path), configuration, method)


def _as_paths(path: Paths) -> tuple[Path, ...]:
    return (Path(path),) if isinstance(path, str | Path) else tuple(Path(each) for each in path)


def _as_array(rows: list[dict[str, Any]], kind: RowKind) -> Rows:
    missing = {field.name: field.missing for field in kind.fields}
    names = {name: None for row in rows or [missing] for name in row}
    columns = {name: np.array([row[name] for row in rows or [missing]]) for name in names}
    array = np.empty(len(rows), [(name, column.dtype, column.shape[1:]) for name, column in columns.items()])
    for name, column in columns.items():
        array[name] = column[: len(rows)]
    return array
