"""Reads a log, or a part of it, into memory: its ticks as one array that is as large as the fields and rows asked for.

The commands on logs read them in blocks instead (scanned_log.py), and work on a log in memory as on one block.
"""

from collections.abc import Callable, Iterator, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from control.records import TWO_FLIPPERS, Rig
from logs.files.file_pass import Spans
from logs.files.log_error import LogCutError, LogError, Watch, unwatched
from logs.files.scanned_log import ScannedLog, scan_logs
from logs.files.tick_array import Ticks, whole_rows


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


AnyLog: TypeAlias = Log | ScannedLog


class TickPass:
    """One pass over the ticks of a log, which reports its progress: `what` names the work, as "ticks replayed" does."""

    def __init__(self, log: AnyLog, watch: Watch, what: str) -> None:
        self._log, self._watch, self._what = log, watch, what
        self._cut: LogCutError | None = None

    def __iter__(self) -> Iterator[Ticks]:
        """Yield blocks of ticks, up to a cut. Raises LogError."""
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
        """Feed every consumer; returns whether the log is complete. Raises LogError."""
        for ticks in self:
            for consume in consumers:
                consume(ticks)
        return self.complete


def read_log(path: Path, watch: Watch = unwatched, from_s: float = -inf, fields: Sequence[str] = ()) -> Log:
    """Read one file; of the rows before `from_s` it reads only the first chunk. Raises LogError."""
    return read_logs([path], watch, from_s, fields)


def read_logs(paths: Sequence[Path], watch: Watch = unwatched, from_s: float = -inf, fields: Sequence[str] = ()) -> Log:
    """Read one log, or joins several segments of one run: all fields of a tick, or some. Raises LogError."""
    scanned = scan_logs(paths, watch, from_s)
    types, names = scanned.tick_type, scanned.tick_type.names or ()
    for name in fields:
        if name not in names:
            raise LogError(f"{paths[0]}: a tick has no field {name}; its fields are {', '.join(names)}")
    if fields:
        types = np.dtype([(name, types[name]) for name in fields])
    ticks, read = np.empty(scanned.rows, types), 0
    passed = TickPass(scanned, watch, "ticks read")
    for block in passed:
        part = ticks[read : read + len(block)]
        read += len(block)
        if not fields:
            whole_rows(part)[:] = whole_rows(block)
        for name in fields:
            part[name] = block[name]
    return Log(
        metadata=scanned.metadata,
        configuration_text=scanned.configuration_text,
        ticks=ticks[:read],
        strides=scanned.strides,
        events=scanned.events,
        complete=passed.complete,
        unknown_fields=scanned.unknown_fields,
        missing_fields=scanned.missing_fields,
        rig=scanned.rig,
    )
