"""Writes a log: reads rows from standard input and writes them into MCAP files, in a process of its own.

The loop must never wait for a disk, so it hands rows over through a pipe, and this program compresses and writes them.
It ends only when its input ends: it ignores the signals meant for the loop, and while a disk refuses, it counts rows.
Once a second it reports the state of the disk on standard output, where it never waits either. Chunks end by time and
the file is synchronised every second, so a crash of this program costs half a second, a power cut one or two, and the
next start recovers the rest (`logs.recovery`).
"""

import json
import os
import select
import signal
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from firmware_host.configuration.log_parameters import ONE_FILE, LogParameters
from firmware_host.log.log_folder import FreeSpace, free_space
from firmware_host.log.recorder import PIPE_BYTES, STAMP, LogReport
from firmware_host.log.row_records import Record, split_records
from firmware_host.log.row_stream import RowStream, read_rights
from firmware_host.log.rows import ROW_KINDS, opening_kinds
from firmware_host.log.segments import LogSegments

GATHER_S = 0.05  # asleep between batches, so that not every row wakes the writer, which would slow the loop
IDLE_MS = 200  # without rows: rows in memory still have to be flushed
REPORT_INTERVAL_S = 1.0
RECENT_REPORTS = 10  # for which a slow write is remembered
LONGEST_MESSAGE = 1000  # bytes in a report, which has to fit into the pipe at once

Rows = list[Record]  # number of the row's kind, encoded row


class Reporter:
    """Owns the pipe back to the loop."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe
        self._slowest_s: deque[float] = deque(maxlen=RECENT_REPORTS)
        self._due_s = 0.0
        self._reported: tuple[Path, str] | None = None
        os.set_blocking(pipe, False)

    def update(self, log: LogSegments) -> None:
        """Report once an interval, and at once where the disk refuses or another file begins."""
        now_s, reported = time.monotonic(), (log.path, log.problem)
        if now_s < self._due_s and reported == self._reported:
            return
        self._due_s, self._reported = now_s + REPORT_INTERVAL_S, reported
        self._slowest_s.append(log.slowest_s)
        log.slowest_s = 0.0
        self.send(log)

    def send(self, log: LogSegments) -> None:
        space = FreeSpace(0.0, 0)
        with suppress(OSError):  # a disk that does not even answer this has no room
            space = free_space(log.path.parent)
        problem, slowest_s = log.problem[:LONGEST_MESSAGE], max(self._slowest_s, default=0.0)
        report = LogReport(
            alive=True,
            dropped=log.dropped,  # by the writer only
            problem=problem,
            free_fraction=space.free_fraction,
            free_bytes=space.free_bytes,
            slowest_write_s=slowest_s,
            durable_stamp_s=log.durable_stamp_s,
            repairing=log.repairing,
        )
        with suppress(OSError):  # the loop is busy or has ended
            os.write(self._pipe, json.dumps([str(log.path), *report]).encode() + b"\n")


def write_log(pipe: int, reports: int, path: Path) -> bool:
    """Write everything that comes through the pipe; without an opening, no file is made."""
    batches = _read_batches(pipe)
    rows = next((batch for batch in batches if batch), [])
    if not rows or not rows[0][1]:
        return True
    opening = json.loads(rows.pop(0)[1])
    log = LogSegments(path, opening, LogParameters(**opening["parameters"]) if "parameters" in opening else ONE_FILE)
    reporter, stream = Reporter(reports), _open_stream(opening)
    reporter.update(log)
    for batch in chain([rows], batches):
        valid = [row for row in batch if row[0] < len(ROW_KINDS) and len(row[1]) >= STAMP.size]
        if stream is not None:
            stream.publish(valid)  # first: a disk may be slow
        log.write(valid)
        reporter.update(log)
    if stream is not None:
        stream.close()
    whole = log.close()
    reporter.send(log)
    return whole


def _open_stream(opening: dict[str, Any]) -> RowStream | None:
    """Return the stream for subscribers; None where the loop asks for none."""
    wanted = opening.get("stream")
    if wanted is None:
        return None
    stream = RowStream(
        Path(wanted["path"]),
        read_rights(wanted["rights"]),
        opening["metadata"],
        opening["configuration_text"],
        opening_kinds(opening),
    )
    if stream.problem:
        print(f"warning: {stream.problem}", file=sys.stderr, flush=True)
    return stream


def _read_batches(pipe: int) -> Iterator[Rows]:
    """Yield whole rows as they come, or none after a while without any, until the input ends."""
    poll = select.poll()
    poll.register(pipe, select.POLLIN | select.POLLHUP)
    unread = b""
    while True:
        if not poll.poll(IDLE_MS):
            yield []
            continue
        piece = os.read(pipe, PIPE_BYTES)
        if not piece:
            return
        rows, unread = split_records(unread + piece)
        yield rows
        time.sleep(GATHER_S)


def main() -> None:
    """Ignore the loop's signals, give up its real-time priority, take the CPU last, and write the log."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with suppress(PermissionError):  # a hardened service may refuse both; the log is written all the same
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.nice(10)
    if not write_log(sys.stdin.fileno(), sys.stdout.fileno(), Path(sys.argv[1])):
        sys.exit(1)


if __name__ == "__main__":
    main()
