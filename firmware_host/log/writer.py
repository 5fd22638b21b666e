"""The writer of a log: rows from standard input into MCAP files, in a process of its own.

The loop must never wait for a disk, so it hands rows over in a pipe and this program compresses and writes
them. It ends when its input ends, and only then: signals meant for the loop pass it by, and a disk that refuses
is waited for while rows are counted. Once a second it reports how the disk is on standard output, where it never
waits either. Chunks end by time and the file is synchronised every second, so a crash of this program costs half a
second, a power cut one or two, and what was written is put in order at the next start
(`firmware_host.log_reading.recovery`).
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from firmware_host.log.log_folder import FreeSpace, free_space
from firmware_host.log.log_parameters import ONE_FILE, LogParameters
from firmware_host.log.recorder import HEADER, PIPE_BYTES, STAMP
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.segments import LogSegments

GATHER_S = 0.05  # asleep between batches, the writer is not woken by every row, which the loop would pay for
IDLE_MS = 200  # without rows: what is in memory still has to be flushed
REPORT_INTERVAL_S = 1.0
LATELY = 10  # reports for which a slow write is remembered
LONGEST_MESSAGE = 1000  # of a report, which has to go into the pipe in one piece

Rows = list[tuple[int, bytes]]  # index in ROW_KINDS, payload


class Reporter:
    """Owns the pipe back to the loop."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe
        self._slowest_s: deque[float] = deque(maxlen=LATELY)
        self._due_s = 0.0
        self._said = ""
        os.set_blocking(pipe, False)

    def update(self, log: LogSegments) -> None:
        now_s = time.monotonic()
        if now_s < self._due_s and log.problem == self._said:
            return
        self._due_s, self._said = now_s + REPORT_INTERVAL_S, log.problem
        self._slowest_s.append(log.slowest_s)
        log.slowest_s = 0.0
        self.send(log)

    def send(self, log: LogSegments) -> None:
        space = FreeSpace(0.0, 0)
        with suppress(OSError):  # a disk that does not even answer this has no room
            space = free_space(log.path.parent)
        report = {
            "path": str(log.path),
            "dropped": log.dropped,
            "problem": log.problem[:LONGEST_MESSAGE],
            "free_share": space.free_fraction,
            "free_bytes": space.free_bytes,
            "slowest_write_s": max(self._slowest_s, default=0.0),
        }
        with suppress(OSError):  # nobody reads, or nobody is there any more
            os.write(self._pipe, json.dumps(report).encode() + b"\n")


def write_log(pipe: int, reports: int, path: Path) -> bool:
    """Everything that comes through the pipe. Without an opening there is nothing to log, and no file."""
    batches = _read_batches(pipe)
    rows = next((batch for batch in batches if batch), [])
    if not rows or not rows[0][1]:
        return True
    opening = json.loads(rows.pop(0)[1])
    log = LogSegments(path, opening, LogParameters(**opening["parameters"]) if "parameters" in opening else ONE_FILE)
    reporter = Reporter(reports)
    reporter.update(log)
    log.write(_sound(rows))
    for rows in batches:
        log.write(_sound(rows))
        reporter.update(log)
    whole = log.close()
    reporter.send(log)
    return whole


def _sound(rows: Rows) -> Rows:
    """Rows that have a kind and a stamp, as every row of the recorder has."""
    return [row for row in rows if row[0] < len(ROW_KINDS) and len(row[1]) >= STAMP.size]


def _read_batches(pipe: int) -> Iterator[Rows]:
    """Whole rows as they come, or none after a while without any, until the input ends."""
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
        rows, unread = _split(unread + piece)
        yield rows
        time.sleep(GATHER_S)


def _split(unread: bytes) -> tuple[Rows, bytes]:
    rows: Rows = []
    place = 0
    while place + HEADER.size <= len(unread):
        kind_index, length = HEADER.unpack_from(unread, place)
        end = place + HEADER.size + length
        if end > len(unread):
            break
        rows.append((kind_index, unread[place + HEADER.size : end]))
        place = end
    return rows, unread[place:]


def _keep_out_of_the_way() -> None:
    """Of the loop: take no signal meant for it, none of its real-time priority, and the CPU last."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with suppress(PermissionError):  # a hardened service may refuse both; the log is written all the same
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.nice(10)


def main() -> None:
    _keep_out_of_the_way()
    if not write_log(sys.stdin.fileno(), sys.stdout.fileno(), Path(sys.argv[1])):
        sys.exit(1)


if __name__ == "__main__":
    main()
