"""The writer of a log: rows from standard input into an MCAP file, in a process of its own.

The loop must never wait for a disk, so it hands rows over in a pipe and this program compresses and writes
them. It ends when its input ends, and only then: signals meant for the loop pass it by, so the log is
finished after the last row, whatever ended the loop. Chunks are small and the file is synchronised every
second, so a power cut costs the last second or two and leaves the rest readable (`firmware_host.log_reader`).
"""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from firmware_host.log_rows import ROW_KINDS
from firmware_host.recorder import HEADER, PIPE_BYTES, STAMP

CHUNK_BYTES = 64 * 1024  # half a second of ticks: what a crash may cost
SYNC_INTERVAL_S = 1.0
GATHER_S = 0.05  # asleep between batches, the writer is not woken by every row, which the loop would pay for

Rows = list[tuple[int, bytes]]  # index in ROW_KINDS, payload


class LogFile:
    """An MCAP file under construction: one channel per kind of row."""

    def __init__(self, path: Path, opening: dict[str, Any]) -> None:
        if not path.parent.exists():
            path.parent.mkdir(parents=True)
        self._path = path
        self._file = path.open("xb")  # a log is never written over
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.LZ4)
        self._wall_offset_ns = int(opening["wall_minus_monotonic_ns"])
        self._latest_ns = self._wall_offset_ns
        self._sequences = [0] * len(ROW_KINDS)
        self._write_opening(opening["configuration_text"], opening["metadata"])
        self._channels = self._register_channels()
        self._synchronise()

    def _write_opening(self, configuration_text: str, metadata: dict[str, str]) -> None:
        self._writer.start(profile="ros2", library="mudskipper")
        offset = {"wall_minus_monotonic_ns": str(self._wall_offset_ns)}
        self._writer.add_metadata("mudskipper", metadata | offset)
        now_ns = time.time_ns()
        self._writer.add_attachment(
            now_ns, now_ns, "configuration.toml", "application/toml", configuration_text.encode()
        )

    def _register_channels(self) -> list[int]:
        channels = []
        for kind in ROW_KINDS:
            schema = self._writer.register_schema(kind.schema_name, "ros2msg", kind.ros_text.encode())
            channels.append(self._writer.register_channel(kind.topic, "cdr", schema))
        return channels

    def write(self, rows: Rows) -> None:
        for kind_index, payload in rows:
            log_time_ns = self._wall_time_ns(payload)
            sequence = self._sequences[kind_index]
            self._sequences[kind_index] += 1
            channel = self._channels[kind_index]
            self._writer.add_message(channel, log_time_ns, payload, log_time_ns, sequence)
        if time.monotonic() - self._synchronised_s > SYNC_INTERVAL_S:
            self._synchronise()

    def _wall_time_ns(self, payload: bytes) -> int:
        """Of the row's stamp; a row without a usable one is placed with the row before it."""
        (stamp_s,) = STAMP.unpack_from(payload)
        if math.isfinite(stamp_s):
            self._latest_ns = max(0, self._wall_offset_ns + round(stamp_s * 1e9))
        return self._latest_ns

    def _synchronise(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())
        self._synchronised_s = time.monotonic()

    def finish(self) -> None:
        """The index, and everything down to the disk, the file's name included."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._synchronise()
        self._file.close()
        folder = os.open(self._path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def write_log(pipe: int, path: Path) -> None:
    """Everything that comes through the pipe. Without an opening there is nothing to log, and no file."""
    batches = _read_batches(pipe)
    (_, opening), *rows = next(batches, [(0, b"")])
    if not opening:
        return
    log = LogFile(path, json.loads(opening))
    log.write(rows)
    for rows in batches:
        log.write(rows)
    log.finish()


def _read_batches(pipe: int) -> Iterator[Rows]:
    """Whole rows as they come, until the input ends."""
    unread = b""
    while piece := os.read(pipe, PIPE_BYTES):
        unread += piece
        rows, unread = _split(unread)
        if rows:
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
    path = Path(sys.argv[1])
    try:
        write_log(sys.stdin.fileno(), path)
    except OSError as error:
        sys.exit(f"The log {path} cannot be written: {error.strerror or error}.")


if __name__ == "__main__":
    main()
