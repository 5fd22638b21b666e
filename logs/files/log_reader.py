"""Reads a log, or a part of it, into memory: its ticks as one array that is as large as the fields and rows asked for.

The commands on logs read them in blocks instead (scanned_log.py), and work on a log in memory as on one block.
"""

from collections.abc import Iterator, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from control.records import TWO_FLIPPERS, Rig
from logs.files.file_pass import Spans
from logs.files.log_error import LogError, Watch, unwatched
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


def watched_blocks(log: AnyLog, watch: Watch, what: str) -> Iterator[Ticks]:
    """Yield blocks of ticks and report progress: `what` names the work, as "ticks replayed" does. Raises LogError."""
    done = 0
    for ticks in log.blocks():
        watch(what, done, log.rows)
        yield ticks
        done += len(ticks)


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
    for block in watched_blocks(scanned, watch, "ticks read"):
        part = ticks[read : read + len(block)]
        read += len(block)
        if not fields:
            whole_rows(part)[:] = whole_rows(block)
        for name in fields:
            part[name] = block[name]
    known = {name: getattr(scanned, name) for name in Log._fields if name != "ticks"}
    return Log(ticks=ticks[:read], **known)
