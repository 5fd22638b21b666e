"""One MCAP file under construction, and how many of its rows are safe.

The MCAP writer fills a buffer in memory. `flush` ends the chunk and hands the buffer to the kernel, so every row so far
survives the death of this process; after the next synchronisation every row survives a power cut. When the disk refuses
a write, the file is cut back to the last flush, so that the number of rows in it is known.

The writer holds a lock on its file (flock), which the kernel releases when the process ends: the writer of an unlocked
file in active/ is dead, and the file needs recovery.
"""

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

from firmware_host.log.log_folder import copy_owner, finished_path, make_folder, synchronise_folder
from firmware_host.log.rows import opening_kinds
from firmware_host.log.schema import RowKind

CHUNK_BYTES = 64 * 1024
FLUSH_INTERVAL_S = 0.4  # the death of the writer may cost as much
SYNC_INTERVAL_S = 1.0  # a power cut may cost as much, and the time of a synchronisation
LATEST_NS = (1 << 63) - 1
METADATA = "mudskipper"
ANNOTATION = "mudskipper_annotation"  # metadata that were added to a closed log; their values replace earlier ones
EXPORTED = "exported"  # key of the metadata in a copy that `log export --ros` of version 0.2 made
ATTACHMENT = "configuration.toml"

Rows = Sequence[tuple[int, bytes]]  # number of the row's kind, encoded row


class _Buffer:
    """The stream that the MCAP writer writes to. It owns the bytes that are not in the file yet."""

    def __init__(self) -> None:
        self.unwritten = bytearray()
        self.length = 0  # of everything, written or not

    def write(self, piece: bytes) -> None:
        self.unwritten += piece
        self.length += len(piece)

    def tell(self) -> int:
        return self.length

    def flush(self) -> None:
        """Part of a stream's interface; `LogFile.flush` writes."""


class LogFile:
    """Owns a new, locked file. Every method may raise OSError; after that only `abandon` may be called."""

    def __init__(self, path: Path, opening: Mapping[str, Any], kinds: Sequence[RowKind] = ()) -> None:
        """`kinds`, if given, describe the rows: a recovered log keeps the description that it had."""
        kinds = kinds or opening_kinds(opening)
        make_folder(path.parent)
        self.path = path
        self.rows = self.safe_rows = 0
        self.slowest_s = 0.0  # write or synchronisation since this was last set to zero
        self._kinds = kinds
        self._file = path.open("xb", buffering=0)  # never overwrites a log
        self._buffer = _Buffer()
        stream: Any = self._buffer  # has everything of a stream that the MCAP writer uses
        self._writer = Writer(stream, chunk_size=1 << 40, compression=CompressionType.LZ4)
        self.durable_stamp_s = math.nan  # of the newest row that a power cut would leave
        self._written_stamp_s = self._flushed_stamp_s = math.nan
        self._wall_offset_ns = int(opening["wall_minus_monotonic_ns"])
        self._latest_ns = min(max(0, self._wall_offset_ns), LATEST_NS)
        self._channels: list[int] = []
        self._sequences = [0] * len(kinds)
        self._chunk_bytes = self._safe_bytes = 0
        try:
            lock_file(self._file.fileno(), path)
            copy_owner(self._file.fileno(), path.parent)
            self._write_opening(opening["configuration_text"], opening["metadata"])
            for kind in kinds:
                schema = self._writer.register_schema(kind.schema_name, "ros2msg", kind.definition.encode())
                self._channels.append(self._writer.register_channel(kind.topic, "cdr", schema, kind.metadata))
            self._write_out()
            self._synchronise()
            synchronise_folder(path.parent)  # the name too
        except OSError:
            self.abandon()
            raise

    def _write_opening(self, configuration_text: str, metadata: dict[str, str]) -> None:
        self._writer.start(profile="ros2", library="mudskipper")
        offset = {"wall_minus_monotonic_ns": str(self._wall_offset_ns)}
        self._writer.add_metadata(METADATA, metadata | offset)
        now_ns = time.time_ns()
        self._writer.add_attachment(now_ns, now_ns, ATTACHMENT, "application/toml", configuration_text.encode())

    @property
    def length(self) -> int:
        """Return the number of bytes, including those that are not on the disk yet."""
        return self._buffer.length + self._chunk_bytes

    def write(self, rows: Rows) -> None:
        for number, row in rows:
            self._written_stamp_s = self._kinds[number].stamp_s(row)
            log_time_ns = self._wall_time_ns(self._written_stamp_s)
            self._writer.add_message(self._channels[number], log_time_ns, row, log_time_ns, self._sequences[number])
            self._sequences[number] += 1
            self.rows += 1
            self._chunk_bytes += len(row)
            if self._chunk_bytes >= CHUNK_BYTES:
                self.flush()
        self._flush_by_time()

    def _flush_by_time(self) -> None:
        now_s = time.monotonic()
        due = now_s - self._synchronised_s > SYNC_INTERVAL_S
        if self.rows > self.safe_rows and (due or now_s - self._flushed_s > FLUSH_INTERVAL_S):
            self.flush()
        if due and self._unsynchronised:
            self._synchronise()

    def _wall_time_ns(self, stamp_s: float) -> int:
        """Return the time of a row by the wall clock; without a usable stamp, that of the row before it."""
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
        self._flushed_stamp_s = self._written_stamp_s
        self._unsynchronised = True
        self._flushed_s = time.monotonic()
        self.slowest_s = max(self.slowest_s, self._flushed_s - started_s)

    def _synchronise(self) -> None:
        started_s = time.monotonic()
        os.fsync(self._file.fileno())
        self._require_path()
        self._unsynchronised = False
        self.durable_stamp_s = self._flushed_stamp_s
        self._synchronised_s = started_s  # what came meanwhile is not durable
        self.slowest_s = max(self.slowest_s, time.monotonic() - started_s)

    def _require_path(self) -> None:
        """Raise FileNotFoundError for a removed file: writing into it would not fail."""
        if _is_at(self.path, self._file.fileno()):
            return
        if os.fstat(self._file.fileno()).st_nlink == 0:
            self.safe_rows = 0
        raise FileNotFoundError(errno.ENOENT, "it was removed or moved away")

    def finish(self) -> Path:
        """Write the index and synchronise everything, the name included; move a file in active/ to done/."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._write_out()
        self._synchronise()
        path = finished_path(self.path)
        if path != self.path:
            make_folder(path.parent)
            self.path.rename(path)
            synchronise_folder(path.parent)
        synchronise_folder(self.path.parent)
        self._file.close()  # ends the lock, now that nothing is left to recover
        return path

    def abandon(self) -> None:
        """Cut the file back to the last flush and close it; remove a file without rows. Never raises OSError."""
        with suppress(OSError):
            os.ftruncate(self._file.fileno(), self._safe_bytes)
        if self.safe_rows == 0:
            with suppress(OSError):
                if _is_at(self.path, self._file.fileno()):
                    self.path.unlink()
        with suppress(OSError):
            self._file.close()


def lock_file(descriptor: int, path: Path) -> None:
    """Raise OSError if another process holds the lock, or has moved the file away meanwhile."""
    flock(descriptor, LOCK_EX | LOCK_NB)
    if not _is_at(path, descriptor):
        raise FileNotFoundError(errno.ENOENT, "was moved away", str(path))


def _is_at(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False
