"""Reads a log, or a part of it, into memory: its ticks as one array that is as large as the fields and rows asked for.

The commands on logs read them in blocks instead (scanned_log.py), and work on a log in memory as on one block.
"""

from collections.abc import Callable, Iterator, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from control.records import TWO_FLIPPERS, Rig
from logs.files.file_pass import Spans
from logs.files.log_error import LogCutError, LogError, Watch, unwatched
from logs.files.scanned_log import ScannedLog, scan_logs
from logs.files.tick_array import Ticks, whole_rows


class AnyLog(Protocol):
    """What the readers of logs need: a ScannedLog or a Log."""

    @property
    def metadata(self) -> dict[str, str]: ...
    @property
    def configuration_text(self) -> str: ...
    @property
    def strides(self) -> list[dict[str, Any]]: ...
    @property
    def events(self) -> list[dict[str, Any]]: ...
    @property
    def complete(self) -> bool: ...
    @property
    def unknown_fields(self) -> tuple[str, ...]: ...
    @property
    def missing_fields(self) -> tuple[str, ...]: ...
    @property
    def rig(self) -> Rig: ...
    @property
    def rows(self) -> int: ...
    @property
    def ends(self) -> Ticks: ...
    def blocks(self, watch: Watch = ..., spans: Spans = ...) -> Iterator[Ticks]: ...


class Log(NamedTuple):
    """One log, or the joined segments of one run."""

    metadata: dict[str, str]
    configuration_text: str
    ticks: Ticks  # the fields of rows.TICK, then those that this version does not know; or the fields asked for
    strides: list[dict[str, Any]]
    events: list[dict[str, Any]]
    complete: bool  # False where the writer was cut off; everything before that is here
    unknown_fields: tuple[str, ...] = ()  # such as "/tick battery_v", which this version does not know
    missing_fields: tuple[str, ...] = ()  # which the version that wrote the log did not know
    rig: Rig = TWO_FLIPPERS  # whose joints and flippers the arrays of a tick have, in its order

    @property
    def rows(self) -> int:
        return len(self.ticks)

    @property
    def ends(self) -> Ticks:
        """The first and the last tick; empty where there is none."""
        return self.ticks[[0, -1]] if len(self.ticks) else self.ticks

    def blocks(self, watch: Watch = unwatched, spans: Spans = ()) -> Iterator[Ticks]:
        yield self.ticks


class TickPass:
    """One pass over the ticks of a log, which reports its progress: `what` names the work, as "ticks replayed" does."""

    def __init__(self, log: AnyLog, watch: Watch, what: str) -> None:
        self._log, self._watch, self._what = log, watch, what
        self._cut: LogCutError | None = None

    def __iter__(self) -> Iterator[Ticks]:
        """Yields blocks of ticks, up to a cut. Raises LogError."""
        done = 0
        try:
            for ticks in self._log.blocks():
                self._watch(self._what, done, self._log.rows)
                yield ticks
                done += len(ticks)
        except LogCutError as cut:
            self._cut = cut

    @property
    def complete(self) -> bool:
        """False where the log was cut off before or during the pass."""
        return self._log.complete and self._cut is None

    def raise_cut(self) -> None:
        """Raises LogCutError where the log was cut off during the pass."""
        if self._cut is not None:
            raise self._cut

    def feed(self, *consumers: Callable[[Ticks], None]) -> bool:
        """Feeds every consumer; returns whether the log is complete. Raises LogError."""
        for ticks in self:
            for consume in consumers:
                consume(ticks)
        return self.complete


def read_log(path: Path, watch: Watch = unwatched, from_s: float = -inf, fields: Sequence[str] = ()) -> Log:
    """Reads one file; of the rows before `from_s` it reads only the first chunk. Raises LogError."""
    return read_logs([path], watch, from_s, fields)


def read_logs(paths: Sequence[Path], watch: Watch = unwatched, from_s: float = -inf, fields: Sequence[str] = ()) -> Log:
    """Reads one log, or joins several segments of one run: all fields of a tick, or some. Raises LogError."""
    scanned = scan_logs(paths, watch, from_s)
    array = _TickArray(paths[0], scanned, fields)
    complete = TickPass(scanned, watch, "ticks read").feed(array.add)
    return Log(
        metadata=scanned.metadata,
        configuration_text=scanned.configuration_text,
        ticks=array.filled,
        strides=scanned.strides,
        events=scanned.events,
        complete=complete,
        unknown_fields=scanned.unknown_fields,
        missing_fields=scanned.missing_fields,
        rig=scanned.rig,
    )


class _TickArray:
    """Owns an array with room for all ticks, or for some of their fields."""

    def __init__(self, path: Path, log: ScannedLog, fields: Sequence[str]) -> None:
        """Raises LogError for a field that the log does not have."""
        names = log.tick_type.names or ()
        for name in fields:
            if name not in names:
                raise LogError(f"{path}: a tick has no field {name}; its fields are {', '.join(names)}")
        self._fields = fields
        types = np.dtype([(name, log.tick_type[name]) for name in fields]) if fields else log.tick_type
        self._array, self._rows = np.empty(log.rows, types), 0

    def add(self, ticks: Ticks) -> None:
        part = self._array[self._rows : self._rows + len(ticks)]
        self._rows += len(ticks)
        if not self._fields:
            whole_rows(part)[:] = whole_rows(ticks)
        for name in self._fields:
            part[name] = ticks[name]

    @property
    def filled(self) -> Ticks:
        return self._array[: self._rows]
