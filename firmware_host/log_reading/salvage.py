"""What can still be read of a log, however damaged: every row in a chunk whose checksum holds, wherever it stands.

Chunks are looked for by their signature anywhere in the file, so damage in the middle costs what it touches and nothing
after it. A row found twice is kept once. The gaps in each channel's sequence numbers say how many rows were lost.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from mcap.records import Attachment, Channel, Chunk, DataEnd, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from firmware_host.log.chunks import RECORD_HEAD, Row, open_chunk, records_of
from firmware_host.log.recorder import STAMP
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log_reading.log_reader import (
    DAMAGE,
    OTHER_VERSION,
    LayoutError,
    LogError,
    Watch,
    require_layout,
    unwatched,
)

SIGNATURE = struct.pack("<I", 3) + b"lz4"  # in the head of every chunk of ours, behind:
FOREIGN_SIGNATURE = struct.pack("<I", 4) + b"zstd"
CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size and checksum of the content
LENGTH = struct.Struct("<Q")
CHUNK_OPCODE = 6
LARGEST_CHUNK = 16 << 20  # bytes, when opened
NANOSECONDS = 1e9


class Salvage(NamedTuple):
    """All that a damaged file still holds."""

    metadata: dict[str, str]
    configuration_text: str
    rows: list[tuple[int, bytes]]
    lost: int  # in damaged places
    foreign: int  # rows of topics that are not ours
    wall_offset_ns: int
    ended: bool  # its writer came to the end


def readable_rows(contents: bytes) -> int:
    """Of our topics, each once, up to the first damage."""
    topics: dict[int, str] = {}
    rows: set[tuple[str, int]] = set()
    ours = {kind.topic for kind in ROW_KINDS}
    reader = StreamReader(BytesIO(contents), emit_chunks=True, record_size_limit=len(contents))
    with suppress(*DAMAGE):
        for outer in reader.records:
            if isinstance(outer, DataEnd):
                break  # what follows tells of rows and holds none
            for record in records_of(open_chunk(outer)) if isinstance(outer, Chunk) else (outer,):
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Row | Message) and topics.get(record.channel_id) in ours:
                    payload = record.payload if isinstance(record, Row) else record.data
                    rows.add((topics[record.channel_id], hash(payload)))
    return len(rows)


def salvage_rows(path: Path, contents: bytes, watch: Watch = unwatched) -> Salvage:
    """Raises LogError for what never was a log of ours, or is one of another version."""
    if FOREIGN_SIGNATURE in contents:
        raise LogError(f"{path}: left as it is: another program has compressed it anew, which cannot be recovered here")
    metadata, configuration_text = _read_head(contents)
    sorter = _RowSorter()
    try:
        for chunk in _sound_chunks(contents, watch):
            sorter.add(chunk)
    except LayoutError as error:
        raise LayoutError(f"{path}: left as it is: {error}; {OTHER_VERSION}") from None
    if not sorter.rows and not metadata:
        raise LogError(f"{path}: nothing of a log can be found in it; remove it")
    offset_ns = sorter.wall_offset_ns
    with suppress(KeyError, ValueError):
        offset_ns = int(metadata.pop("wall_minus_monotonic_ns"))
    ended = contents.endswith(MCAP0_MAGIC) and len(contents) > len(MCAP0_MAGIC)
    return Salvage(metadata, configuration_text, sorter.rows, sorter.lost, sorter.foreign, offset_ns, ended)


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


def _sound_chunks(contents: bytes, watch: Watch) -> Iterator[list[Row | Schema | Channel]]:
    """Wherever they stand, in their order."""
    place = 0
    while (signature := contents.find(SIGNATURE, place)) >= 0:
        watch("kB searched", place // 1000, len(contents) // 1000)
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
        self.wall_offset_ns = 0
        self._kinds = {number + 1: number for number in range(len(ROW_KINDS))}  # as LogFile numbers its channels
        self._schemas: dict[int, Schema] = {}
        self._seen: list[set[int]] = [set() for _ in ROW_KINDS]
        self._foreign: set[tuple[int, int, int]] = set()

    @property
    def lost(self) -> int:
        """Rows whose numbers are missing before the last one found."""
        return sum(max(seen) + 1 - len(seen) for seen in self._seen if seen)

    @property
    def foreign(self) -> int:
        """Rows of topics that are not ours."""
        return len(self._foreign)

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
        """Raises LayoutError."""
        topics = [kind.topic for kind in ROW_KINDS]
        self._kinds.pop(channel.id, None)
        if channel.topic in topics:
            require_layout(channel, self._schemas.get(channel.schema_id))
            self._kinds[channel.id] = topics.index(channel.topic)

    def _add_row(self, row: Row) -> None:
        kind = self._kinds.get(row.channel_id)
        if kind is None:
            self._foreign.add((row.channel_id, row.sequence, hash(row.payload)))
            return
        if row.sequence in self._seen[kind] or len(row.payload) < STAMP.size:
            return
        if not self.rows:
            with suppress(ValueError, OverflowError):
                self.wall_offset_ns = row.log_time_ns - round(STAMP.unpack_from(row.payload)[0] * NANOSECONDS)
        self._seen[kind].add(row.sequence)
        self.rows.append((kind, row.payload))
