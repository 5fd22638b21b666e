"""One MCAP file under construction, and what of it is safe.

The MCAP writer fills a buffer in memory; `flush` ends the chunk and hands the buffer to the kernel, so after a flush
every row so far survives the death of this process, and after a `synchronise` a power cut. When the disk refuses, the
file is cut back to the last flush: what it holds is then known to the row.

The writer holds a lock on its file (flock), which ends with the process, whatever ended it: an unlocked file in
active/ is one that nobody will finish.
"""

from __future__ import annotations

import errno
import math
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from firmware_host.log.log_folder import finished_path, make_folder, synchronise_folder, take_owner
from firmware_host.log.recorder import STAMP
from firmware_host.log.rows import ROW_KINDS

CHUNK_BYTES = 64 * 1024
FLUSH_INTERVAL_S = 0.4  # what the death of the writer may cost
SYNC_INTERVAL_S = 1.0  # what a power cut may cost
LATEST_NS = (1 << 63) - 1
METADATA = "mudskipper"
ATTACHMENT = "configuration.toml"

Rows = Sequence[tuple[int, bytes]]  # index in ROW_KINDS, payload


class _Buffer:
    """The stream that the MCAP writer writes to."""

    def __init__(self) -> None:
        self.unwritten = bytearray()
        self.length = 0  # of everything, written or not

    def write(self, piece: bytes) -> None:
        self.unwritten += piece
        self.length += len(piece)

    def tell(self) -> int:
        return self.length

    def flush(self) -> None:
        """Part of the interface; `LogFile.flush` is what writes."""


class LogFile:
    """Made new and locked. Every method may raise OSError; only `abandon` is of use then."""

    def __init__(self, path: Path, opening: Mapping[str, Any]) -> None:
        make_folder(path.parent)
        self.path = path
        self.rows = self.safe_rows = 0
        self.slowest_s = 0.0  # write or synchronisation since somebody set this to zero
        self._file = path.open("xb", buffering=0)  # a log is never written over
        self._buffer = _Buffer()
        stream: Any = self._buffer  # all of a stream that the MCAP writer uses
        self._writer = Writer(stream, chunk_size=1 << 40, compression=CompressionType.LZ4)
        self._wall_offset_ns = int(opening["wall_minus_monotonic_ns"])
        self._latest_ns = min(max(0, self._wall_offset_ns), LATEST_NS)
        self._sequences = [0] * len(ROW_KINDS)
        self._chunk_bytes = self._safe_bytes = 0
        try:
            lock_file(self._file.fileno(), path)
            take_owner(path)
            self._write_opening(opening["configuration_text"], opening["metadata"])
            self._channels = self._register_channels()
            self._write_out()
            self._synchronise()
        except OSError:
            self.abandon()
            raise

    def _write_opening(self, configuration_text: str, metadata: dict[str, str]) -> None:
        self._writer.start(profile="ros2", library="mudskipper")
        offset = {"wall_minus_monotonic_ns": str(self._wall_offset_ns)}
        self._writer.add_metadata(METADATA, metadata | offset)
        now_ns = time.time_ns()
        self._writer.add_attachment(now_ns, now_ns, ATTACHMENT, "application/toml", configuration_text.encode())

    def _register_channels(self) -> list[int]:
        channels = []
        for kind in ROW_KINDS:
            schema = self._writer.register_schema(kind.schema_name, "ros2msg", kind.ros_text.encode())
            channels.append(self._writer.register_channel(kind.topic, "cdr", schema))
        return channels

    @property
    def length(self) -> int:
        """Bytes, with those that are not on the disk yet."""
        return self._buffer.length + self._chunk_bytes

    def write(self, rows: Rows) -> None:
        for kind_index, payload in rows:
            log_time_ns = self._wall_time_ns(payload)
            sequence = self._sequences[kind_index]
            self._sequences[kind_index] += 1
            self._writer.add_message(self._channels[kind_index], log_time_ns, payload, log_time_ns, sequence)
            self.rows += 1
            self._chunk_bytes += len(payload)
            if self._chunk_bytes >= CHUNK_BYTES:
                self.flush()
        self.keep_up()

    def keep_up(self) -> None:
        """Flush and synchronise when it is time to."""
        now_s = time.monotonic()
        if now_s - self._flushed_s > FLUSH_INTERVAL_S and self.rows > self.safe_rows:
            self.flush()
        if now_s - self._synchronised_s > SYNC_INTERVAL_S and self._unsynchronised:
            self._synchronise()

    def _wall_time_ns(self, payload: bytes) -> int:
        """Of the row's stamp; a row without a usable one is placed with the row before it."""
        (stamp_s,) = STAMP.unpack_from(payload)
        if math.isfinite(stamp_s) and abs(stamp_s) < 1e9:
            self._latest_ns = min(max(0, self._wall_offset_ns + round(stamp_s * 1e9)), LATEST_NS)
        return self._latest_ns

    def flush(self) -> None:
        """End the chunk, so that a crash of this process no longer costs its rows."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._chunk_bytes = 0
        self._write_out()

    def _write_out(self) -> None:
        started_s = time.monotonic()
        unwritten = memoryview(self._buffer.unwritten)
        try:
            while unwritten:
                unwritten = unwritten[os.write(self._file.fileno(), unwritten) :]
        finally:
            unwritten.release()
        self._buffer.unwritten = bytearray()
        self._safe_bytes, self.safe_rows = self._buffer.length, self.rows
        self._unsynchronised = True
        self._flushed_s = time.monotonic()
        self.slowest_s = max(self.slowest_s, self._flushed_s - started_s)

    def _synchronise(self) -> None:
        started_s = time.monotonic()
        os.fsync(self._file.fileno())
        self._require_place()
        self._unsynchronised = False
        self._synchronised_s = time.monotonic()
        self.slowest_s = max(self.slowest_s, self._synchronised_s - started_s)

    def _require_place(self) -> None:
        """A file that was removed takes every row without a complaint."""
        if _is_at(self.path, self._file.fileno()):
            return
        if os.fstat(self._file.fileno()).st_nlink == 0:
            self.safe_rows = 0
        raise FileNotFoundError(errno.ENOENT, "it was removed or moved away")

    def finish(self) -> Path:
        """The index, and everything down to the disk, the file's name included; a file in active/ goes to done/."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._write_out()
        self._synchronise()
        path = finished_path(self.path)
        if path != self.path:
            make_folder(path.parent)
            self.path.rename(path)
            synchronise_folder(path.parent)
        synchronise_folder(self.path.parent)
        self._file.close()  # and with it the lock, when nothing is left to recover
        return path

    def abandon(self) -> None:
        """Cut back to the last flush and let go; a file without a row is removed. Never raises OSError."""
        with suppress(OSError):
            os.ftruncate(self._file.fileno(), self._safe_bytes)
        if self.safe_rows == 0:
            with suppress(OSError):
                if _is_at(self.path, self._file.fileno()):
                    self.path.unlink()
        with suppress(OSError):
            self._file.close()


def lock_file(descriptor: int, path: Path) -> None:
    """Raises OSError where another process holds it, or has moved it away meanwhile."""
    flock(descriptor, LOCK_EX | LOCK_NB)
    if not _is_at(path, descriptor):
        raise FileNotFoundError(errno.ENOENT, "was moved away", str(path))


def _is_at(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False
