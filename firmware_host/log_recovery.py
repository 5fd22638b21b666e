"""Puts a log in order whose writer was cut off: every row that is still there, with index and statistics.

An unfinished MCAP file lacks the summary at its end, without which most readers refuse it. This one looks for chunks
by their signature anywhere in the file, so damage in the middle costs what it touches and nothing after it, and takes
a chunk only if its checksum holds. A row found twice is kept once. The gaps in each channel's sequence numbers say how
many rows were lost in between, and an event in the rewritten log says so.

The damaged file is set aside as NAME.broken; the new one is written beside the finished ones, brought down to the disk
and renamed; only then does the old one go. Whatever moment this is cut off in, the next run continues.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from firmware_host.log_chunks import RECORD_HEAD, Row, open_chunk, records_of
from firmware_host.log_file import LogFile, lock_file
from firmware_host.log_folder import BROKEN, PART, finished_path, synchronise_folder, unfinished_files
from firmware_host.log_reader import DAMAGE, LogError, read_log
from firmware_host.log_rows import EVENT, ROW_KINDS
from firmware_host.recorder import EVENT_KIND, STAMP

SIGNATURE = struct.pack("<I", 3) + b"lz4"  # in the head of every chunk of ours, behind:
CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size and checksum of the content
LENGTH = struct.Struct("<Q")
CHUNK_OPCODE = 6
LARGEST_CHUNK = 16 << 20  # bytes, when opened
NANOSECONDS = 1e9


class Recovered(NamedTuple):
    """What became of one file."""

    path: Path  # where the log is now
    rows: int  # kept
    lost: int  # rows in damaged places, as far as their numbers tell
    note: str  # in words


class Salvage(NamedTuple):
    """All that a damaged file still holds."""

    metadata: dict[str, str]
    configuration_text: str
    ros_texts: dict[str, str]  # of the rows, by topic
    rows: list[tuple[int, bytes]]
    lost: int
    wall_offset_ns: int


def recover_all(folder: Path, say: Callable[[str], None]) -> list[Recovered]:
    """Every unfinished log of a log folder, except those of living writers. `say` hears of those that resist."""
    recovered = []
    for path in unfinished_files(folder):
        try:
            recovered.append(recover_log(path))
        except (BlockingIOError, FileNotFoundError):
            continue  # being written, or finished meanwhile
        except LogError as problem:
            say(str(problem))
        except OSError as problem:
            say(f"{path}: cannot be recovered: {problem.strerror or problem}")
    return recovered


def recover_log(path: Path) -> Recovered:
    """Raises LogError, and OSError; BlockingIOError where its writer lives."""
    with path.open("rb") as file:
        lock_file(file.fileno(), path)
        if path.name.endswith(PART):
            path.unlink()
            return Recovered(path, 0, 0, "a rewriting that was cut off, removed")
        target = finished_path(path.with_name(path.name.removesuffix(BROKEN)))
        contents = file.read()
        if not contents:
            path.unlink()
            return Recovered(path, 0, 0, "empty, removed")
        if target != path and _is_whole(target):
            path.unlink()
            return Recovered(target, 0, 0, "was recovered before")
        if contents.endswith(MCAP0_MAGIC) and _is_whole(path):
            return _finish_move(path, target)
        return _rewrite(path, target, salvage_rows(path, contents))


def _is_whole(path: Path) -> bool:
    with suppress(LogError):
        return read_log(path).complete
    return False


def _finish_move(path: Path, target: Path) -> Recovered:
    """A whole file whose writer ended between its last byte and the renaming."""
    if target != path:
        target.parent.mkdir(exist_ok=True)
        path.rename(target)
        synchronise_folder(target.parent)
        synchronise_folder(path.parent)
    return Recovered(target, 0, 0, "is whole")


def _rewrite(path: Path, target: Path, salvage: Salvage) -> Recovered:
    broken = path if path.name.endswith(BROKEN) else path.with_name(path.name + BROKEN)
    path.rename(broken)
    part = broken.with_name(target.name + PART)
    part.unlink(missing_ok=True)
    lost = f", {salvage.lost} lost in damaged places" if salvage.lost else ""
    note = f"recovered: {len(salvage.rows)} rows kept{lost}; what came after the last of them is missing"
    opening = {
        "configuration_text": salvage.configuration_text,
        "metadata": salvage.metadata | {"recovered": "true", "rows_lost": str(salvage.lost)},
        "wall_minus_monotonic_ns": salvage.wall_offset_ns,
    }
    log = LogFile(part, opening, salvage.ros_texts)
    try:
        log.write([*salvage.rows, (EVENT_KIND, EVENT.encode(_last_stamp_s(salvage), note))])
        log.finish()
    except OSError:
        log.abandon()
        part.unlink(missing_ok=True)
        raise
    target.parent.mkdir(exist_ok=True)
    part.rename(target)
    for folder in {target.parent, part.parent}:
        synchronise_folder(folder)
    broken.unlink()
    return Recovered(target, len(salvage.rows), salvage.lost, note)


def _last_stamp_s(salvage: Salvage) -> float:
    return float(STAMP.unpack_from(salvage.rows[-1][1])[0]) if salvage.rows else 0.0


def salvage_rows(path: Path, contents: bytes) -> Salvage:
    """Raises LogError for what never was a log of ours."""
    metadata, configuration_text = _read_head(contents)
    sorter = _RowSorter()
    for chunk in _sound_chunks(contents):
        sorter.add(chunk)
    if not sorter.rows and not metadata:
        raise LogError(f"{path}: nothing of a log can be found in it")
    offset_ns = sorter.wall_offset_ns
    with suppress(KeyError, ValueError):
        offset_ns = int(metadata.pop("wall_minus_monotonic_ns"))
    return Salvage(metadata, configuration_text, sorter.ros_texts, sorter.rows, sorter.lost, offset_ns)


def _read_head(contents: bytes) -> tuple[dict[str, str], str]:
    """Metadata and configuration, which stand before the first chunk, as far as they can be read."""
    metadata: dict[str, str] = {}
    text = ""
    if not contents.startswith(MCAP0_MAGIC):
        return metadata, text
    reader = StreamReader(BytesIO(contents), emit_chunks=True, record_size_limit=len(contents))
    with suppress(*DAMAGE):
        for record in reader.records:
            match record:
                case Metadata(name="mudskipper"):
                    metadata = dict(record.metadata)
                case Attachment(name="configuration.toml"):
                    text = record.data.decode()
                case Chunk():
                    break
    return metadata, text


def _sound_chunks(contents: bytes) -> Iterator[list[Row | Schema | Channel]]:
    """Wherever they stand, in their order."""
    place = 0
    while (signature := contents.find(SIGNATURE, place)) >= 0:
        place = signature + 1
        start, data = signature - CHUNK_HEAD.size, signature + len(SIGNATURE) + LENGTH.size
        if start < 0 or data > len(contents):
            continue
        opcode, length, first_ns, last_ns, size, checksum = CHUNK_HEAD.unpack_from(contents, start)
        (compressed,) = LENGTH.unpack_from(contents, data - LENGTH.size)
        end = data + compressed
        sane = opcode == CHUNK_OPCODE and checksum != 0 and size <= LARGEST_CHUNK
        if not sane or end > len(contents) or length != end - start - RECORD_HEAD.size:
            continue
        with suppress(*DAMAGE):
            chunk = Chunk("lz4", contents[data:end], last_ns, first_ns, checksum, size)
            yield list(records_of(open_chunk(chunk)))
            place = end


class _RowSorter:
    """Owns the rows found so far, and which numbers they had."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, bytes]] = []
        self.ros_texts: dict[str, str] = {}
        self.wall_offset_ns = 0
        self._kinds = {number + 1: number for number in range(len(ROW_KINDS))}  # as LogFile numbers its channels
        self._schemas: dict[int, Schema] = {}
        self._seen: list[set[int]] = [set() for _ in ROW_KINDS]

    @property
    def lost(self) -> int:
        """Rows whose numbers are missing before the last one found."""
        return sum(max(seen) + 1 - len(seen) for seen in self._seen if seen)

    def add(self, records: list[Row | Schema | Channel]) -> None:
        for record in records:
            match record:
                case Row():
                    self._add_row(record)
                case Schema():
                    self._schemas[record.id] = record
                case Channel():
                    self._add_channel(record)

    def _add_channel(self, channel: Channel) -> None:
        topics = [kind.topic for kind in ROW_KINDS]
        if channel.topic in topics:
            self._kinds[channel.id] = topics.index(channel.topic)
            if schema := self._schemas.get(channel.schema_id):
                self.ros_texts[channel.topic] = schema.data.decode(errors="replace")

    def _add_row(self, row: Row) -> None:
        kind = self._kinds.get(row.channel_id)
        if kind is None or row.sequence in self._seen[kind] or len(row.payload) < STAMP.size:
            return
        if not self.rows:
            with suppress(ValueError, OverflowError):
                self.wall_offset_ns = row.log_time_ns - round(STAMP.unpack_from(row.payload)[0] * NANOSECONDS)
        self._seen[kind].add(row.sequence)
        self.rows.append((kind, row.payload))


def main() -> None:
    """For the log's writer: everything unfinished in one folder, after whatever is urgent."""
    with suppress(PermissionError):
        os.nice(5)
    folder = Path(sys.argv[1])

    def say(sentence: str) -> None:
        print(sentence, file=sys.stderr, flush=True)

    for recovered in recover_all(folder, say):
        say(f"{recovered.path}: {recovered.note}")


if __name__ == "__main__":
    main()
