"""The loop's side of the log: sends rows through a pipe to the writer's process, and never waits for a disk.

Compressing and writing a log takes milliseconds, and a memory card sometimes takes a second. The writer
(`firmware_host.log.writer`) does both, and `put` is one non-blocking write into a pipe that holds several seconds of
rows. A row is smaller than PIPE_BUF, so the pipe takes it whole or not at all. When the pipe is full, the row is
dropped and counted, and an event in the log reports the loss before the next row.

A second pipe leads back: once a second the writer reports the state of the disk. `report` never waits for it.
"""

import json
import math
import os
import select
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from fcntl import F_SETPIPE_SZ, fcntl
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from control.records import TWO_FLIPPERS, Rig
from firmware_host.configuration.log_parameters import ONE_FILE, LogParameters
from firmware_host.log.log_folder import ACTIVE, present_path, unfinished_files
from firmware_host.log.row_records import HEADER, pack_record
from firmware_host.log.rows import EVENT, EVENT_KIND

PIPE_BYTES = 1 << 20  # 2,304 ticks, nine to a page: six seconds at 380 Hz
STAMP = struct.Struct("<4xd")  # every row of this version: four bytes of encapsulation, then its stamp
REPORT_BYTES = 256  # left free for the report of a loss, which is sent together with a row
LARGEST_ROW = select.PIPE_BUF - HEADER.size - REPORT_BYTES
LONGEST_TEXT = LARGEST_ROW - len(EVENT.encode(0.0, ""))  # bytes
REPORT_CALLS = 95  # calls of `report` between two reads of its pipe: four reads a second at 380 Hz
BLOCKED = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGABRT}  # by the writer
REPORT_OVERDUE_S = 3.0  # without a report: the writer waits for its disk


class LogReport(NamedTuple):
    """The state of the log and its disk: the writer's message, after the log's path."""

    alive: bool  # the writer
    dropped: int  # rows, by the full pipe and by the writer
    problem: str  # a message, or empty
    free_fraction: float  # of the disk; NaN before the first report
    free_bytes: int
    slowest_write_s: float  # in the last ten seconds, an unfinished one included
    durable_stamp_s: float  # of the newest row that a power cut would leave; NaN before the first
    repairing: int  # logs that earlier runs did not finish


HEALTHY = LogReport(  # until the writer reports
    alive=True,
    dropped=0,
    problem="",
    free_fraction=math.nan,
    free_bytes=1 << 62,
    slowest_write_s=0.0,
    durable_stamp_s=math.nan,
    repairing=0,
)


class Recording(Protocol):
    """Takes the rows of a loop."""

    @property
    def path(self) -> Path | None: ...

    def put(self, number: int, row: bytes) -> bool: ...

    def report(self) -> LogReport: ...

    def close(self, timeout_s: float) -> bool: ...


class NullRecorder:
    """Drops every row."""

    path: Path | None = None

    def put(self, number: int, row: bytes) -> bool:
        return True

    def report(self) -> LogReport:
        return HEALTHY

    def close(self, timeout_s: float) -> bool:
        return True


class Recorder:
    """Owns the writer and the pipe to it. Start it before the loop takes real-time priority."""

    def __init__(
        self,
        path: Path,
        configuration_text: str,
        metadata: dict[str, str],
        parameters: LogParameters = ONE_FILE,
        stream: Mapping[str, Any] | None = None,
        rig: Rig = TWO_FLIPPERS,
    ) -> None:
        """`stream` has the path and the rights of the socket on which the writer serves rows to subscribers."""
        self.path = path  # the file that is being written, or was written last
        self.dropped = 0
        self.writer_alive = True
        self._unreported = 0
        self._loss_stamp_s = 0.0
        unfinished = 0 if path.parent.name != ACTIVE else len(unfinished_files(path.parent.parent))
        self._writer = _start_writer(path)
        self.writer_pid = self._writer.pid
        assert self._writer.stdin is not None and self._writer.stdout is not None
        self._pipe, self._reports = self._writer.stdin.fileno(), self._writer.stdout.fileno()
        self._report, self._dropped_by_writer = HEALTHY._replace(repairing=unfinished), 0
        self._calls, self._reported_s = 0, time.monotonic()
        self.malformed_reports = 0
        os.set_blocking(self._reports, False)
        with suppress(PermissionError):  # beyond the user's limit: the pipe keeps its 64 KiB
            fcntl(self._pipe, F_SETPIPE_SZ, PIPE_BYTES)
        opening = {
            "configuration_text": configuration_text,
            "metadata": metadata,
            "parameters": asdict(parameters),
            "flippers": rig.flippers,
            "stream": stream,
        }
        self._send_opening(opening)
        os.set_blocking(self._pipe, False)

    def _send_opening(self, opening: dict[str, Any]) -> None:
        row = json.dumps(opening).encode()
        unsent = memoryview(pack_record(0, row))
        try:
            while unsent:
                unsent = unsent[os.write(self._pipe, unsent) :]
        except BrokenPipeError:
            self.writer_alive = False

    def put(self, number: int, row: bytes) -> bool:
        """Send one row without waiting; return False where it was lost."""
        if len(row) > LARGEST_ROW:
            row = _shorten(row)
        record = pack_record(number, row)
        if self._write(self._loss_report() + record if self._unreported else record):
            self._unreported = 0
            return True
        self.dropped += 1
        self._unreported += 1
        (self._loss_stamp_s,) = STAMP.unpack_from(row)
        return False

    def _write(self, records: bytes) -> bool:
        if not self.writer_alive:
            return False
        try:
            os.write(self._pipe, records)
        except BlockingIOError:
            return False
        except BrokenPipeError:
            self.writer_alive = False
            return False
        return True

    def _loss_report(self) -> bytes:
        """Return the report of a loss, which is sent with the next row: alone it would fit where a row does not."""
        text = f"rows missing here: {self._unreported}, the log's writer did not keep up"
        row = EVENT.encode(self._loss_stamp_s, text)
        return pack_record(EVENT_KIND, row)

    def report(self) -> LogReport:
        """Return the newest report; cheap enough for every tick, since it seldom reads the pipe."""
        self._calls -= 1
        if self._calls < 0:
            self._calls = REPORT_CALLS
            self._read_reports()
        return self._report

    def _read_reports(self) -> None:
        now_s = time.monotonic()
        try:
            received = os.read(self._reports, PIPE_BYTES)
        except BlockingIOError:
            received = b"\n"
        if not received:
            self.writer_alive = False
        lines = received.split(b"\n")[:-1]
        if lines and lines[-1] and self._accept(lines[-1]):
            self._reported_s = now_s
        silent_s = now_s - self._reported_s if self.writer_alive else 0.0
        slowest_s = self._report.slowest_write_s
        self._report = self._report._replace(
            alive=self.writer_alive,
            dropped=self.dropped,
            slowest_write_s=max(slowest_s, silent_s) if silent_s > REPORT_OVERDUE_S else slowest_s,
        )

    def _accept(self, line: bytes) -> bool:
        """Return whether the line is a report: output of any other kind must not end the loop."""
        try:
            path, *values = json.loads(line)
            path = Path(path)
            kinds = LogReport.__annotations__.values()
            report = LogReport(*(kind(value) for kind, value in zip(kinds, values, strict=True)))
        except (TypeError, ValueError, OverflowError, RecursionError):
            self.malformed_reports += 1
            return False
        self.path = path
        self.dropped += report.dropped - self._dropped_by_writer
        self._dropped_by_writer = report.dropped
        self._report = report._replace(alive=self.writer_alive, dropped=self.dropped)
        return True

    def close(self, timeout_s: float) -> bool:
        """End the log; return whether it is whole on the disk. A writer that needs longer finishes alone."""
        assert self._writer.stdin is not None and self._writer.stdout is not None
        deadline_s = time.monotonic() + timeout_s
        if self._unreported and self.writer_alive:
            select.select([], [self._pipe], [], timeout_s)  # waits for room
            self._write(self._loss_report())
        self.writer_alive = False
        self._writer.stdin.close()
        try:
            status = self._writer.wait(max(0.0, deadline_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            return False
        if not self._writer.stdout.closed:
            self._read_reports()
            self._writer.stdout.close()
        if self.malformed_reports:
            print(f"The log's writer sent {self.malformed_reports} malformed reports.", file=sys.stderr, flush=True)
        self.path = present_path(self.path)
        return status == 0


def _start_writer(path: Path) -> subprocess.Popen[bytes]:
    """Start the writer with blocked signals: those of Ctrl-C, a closed terminal and the service reach it too."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, BLOCKED)
    try:
        command = [sys.executable, "-P", "-m", "firmware_host.log.writer", str(path)]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _shorten(row: bytes) -> bytes:
    """Cut the text of an event, the only row that can be this long."""
    event = EVENT.decode(row)
    text = event["text"].encode()[:LONGEST_TEXT].decode(errors="ignore")
    return EVENT.encode(event["stamp_s"], text)
