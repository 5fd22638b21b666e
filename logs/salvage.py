"""Finds every row of a damaged log that a checksum still confirms, at any position in the file.

The chunks are found by their signature anywhere in the file, so damage in the middle costs only the rows that it
touches. A row that is found twice counts once. The gaps in each channel's sequence numbers are the lost rows. The rows
keep the layout that the file describes; where the description is lost, they are taken to have that of this version.

A salvage is one pass over the file, with one chunk and one block of the file in memory.
"""

import os
import struct
from array import array
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import suppress
from math import isfinite
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.records import Attachment, Channel, Chunk, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from firmware_host.log.log_file import ATTACHMENT, METADATA
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.schema import LayoutError
from logs.files.chunks import RECORD_HEAD, Row, open_chunk, split_records
from logs.files.file_pass import KIND_OF_TOPIC, OTHER_VERSION, described_kind
from logs.files.log_error import DAMAGE, LogError, Watch, unwatched

SIGNATURE = struct.pack("<I", 3) + b"lz4"  # in the head of each of our chunks, after CHUNK_HEAD
FOREIGN_SIGNATURE = struct.pack("<I", 4) + b"zstd"
CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size and checksum of the contents
LENGTH = struct.Struct("<Q")
CHUNK_OPCODE = 6
LARGEST_CHUNK = 16 << 20  # bytes, when opened
BLOCK_BYTES = 1 << 18


class FileBytes:
    """The bytes of an open file, read by their position. Owns the block of them that was searched last."""

    def __init__(self, file: BinaryIO) -> None:
        self.file = file
        self.size = os.fstat(file.fileno()).st_size
        self._start, self._block = 0, b""

    def between(self, start: int, end: int) -> bytes:
        """Returns fewer bytes where the file ends before. Raises OSError."""
        return os.pread(self.file.fileno(), end - start, start)

    def find(self, pattern: bytes, start: int) -> int:
        """Returns the first position of a pattern from `start` on, or -1. Raises OSError."""
        while start < self.size:
            if not self._start <= start <= self._start + len(self._block) - len(pattern):
                self._start, self._block = start, self.between(start, start + BLOCK_BYTES)
            if not self._block:
                break  # the file was cut off meanwhile
            found = self._block.find(pattern, start - self._start)
            if found >= 0:
                return self._start + found
            start = self._start + max(1, len(self._block) - len(pattern) + 1)
        return -1

    def plain_records(self) -> Iterator[McapRecord]:
        """Yields the records in the order of the file. Raises DAMAGE and OSError."""
        self.file.seek(0)
        yield from StreamReader(self.file, emit_chunks=True, record_size_limit=self.size).records

    @property
    def begins_as_mcap(self) -> bool:
        return self.between(0, len(MCAP0_MAGIC)) == MCAP0_MAGIC

    @property
    def ends_as_mcap(self) -> bool:
        return self.size > len(MCAP0_MAGIC) and self.between(self.size - len(MCAP0_MAGIC), self.size) == MCAP0_MAGIC


class NumberSet:
    """A set of whole numbers as ranges: the sequence numbers of a sound log are a single one."""

    def __init__(self) -> None:
        self._begins: list[int] = []
        self._ends: list[int] = []  # each one after the last number of its range

    def add(self, number: int) -> bool:
        """Returns whether the number is new."""
        after = bisect_right(self._begins, number)
        if after and number < self._ends[after - 1]:
            return False
        joins_before = after > 0 and self._ends[after - 1] == number
        joins_after = after < len(self._begins) and self._begins[after] == number + 1
        if joins_before and joins_after:
            del self._begins[after], self._ends[after - 1]
        elif joins_before:
            self._ends[after - 1] += 1
        elif joins_after:
            self._begins[after] = number
        else:
            self._begins.insert(after, number)
            self._ends.insert(after, number + 1)
        return True

    @property
    def missing(self) -> int:
        """How many numbers from 0 to the largest one are not in the set."""
        return (self._ends[-1] if self._ends else 0) - sum(
            end - begin for begin, end in zip(self._begins, self._ends, strict=True)
        )


class Salvage:
    """One pass over a damaged file. Owns its layouts, and the numbers of the rows that it has yielded."""

    def __init__(self, contents: FileBytes) -> None:
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.kinds = list(ROW_KINDS)  # as the file describes them
        self.rows = 0  # yielded
        self.last_stamp_s = 0.0  # of the last row; 0 where that is no time
        self.wall_offset_ns = 0
        self._contents = contents
        self._number_of_channel = {number + 1: number for number in range(len(ROW_KINDS))}  # as LogFile numbers them
        self._schemas: dict[int, Schema] = {}
        self._sequences = [NumberSet() for _ in ROW_KINDS]
        self._foreign = _HashedRows()

    @property
    def lost(self) -> int:
        """Rows whose numbers are missing before the last one found."""
        return sum(found.missing for found in self._sequences)

    @property
    def foreign(self) -> int:
        """Rows of unknown topics."""
        return self._foreign.different

    @property
    def ended(self) -> bool:
        """Whether the writer finished the file."""
        return self._contents.ends_as_mcap

    def read_head(self) -> None:
        """Reads the metadata and the configuration, which precede the first chunk, as far as they can be read."""
        if not self._contents.begins_as_mcap:
            return
        with suppress(*DAMAGE):
            for record in self._contents.plain_records():
                match record:
                    case Metadata(name=name) if name == METADATA:
                        self.metadata = dict(record.metadata)
                    case Attachment(name=name) if name == ATTACHMENT:
                        self.configuration_text = record.data.decode()
                    case Chunk():
                        break

    def found_rows(self, watch: Watch = unwatched) -> Iterator[tuple[int, bytes]]:
        """Makes the pass: yields the number of its kind and the bytes of every row. Raises LayoutError, OSError."""
        for chunk in _find_chunks(self._contents, watch):
            for record in chunk:
                match record:
                    case Row():
                        yield from self._new_row(record)
                    case Schema():
                        self._schemas[record.id] = record
                    case Channel():
                        self._add_channel(record)

    def _add_channel(self, channel: Channel) -> None:
        self._number_of_channel.pop(channel.id, None)
        number = KIND_OF_TOPIC.get(channel.topic)
        if number is not None:
            self.kinds[number] = described_kind(number, self._schemas.get(channel.schema_id), channel.metadata)
            self._number_of_channel[channel.id] = number

    def _new_row(self, row: Row) -> Iterator[tuple[int, bytes]]:
        number = self._number_of_channel.get(row.channel_id)
        if number is None:
            self._foreign.add(row.channel_id, row.sequence, row.data)
            return
        if not self.kinds[number].fits(row.data) or not self._sequences[number].add(row.sequence):
            return
        stamp_s = self.kinds[number].stamp_s(row.data)
        if not self.rows:
            with suppress(ValueError, OverflowError):  # of a stamp that is not finite
                self.wall_offset_ns = row.log_time_ns - round(stamp_s * 1e9)
        self.last_stamp_s = stamp_s if isfinite(stamp_s) else 0.0
        self.rows += 1
        yield number, row.data


class _HashedRows:
    """Counts different rows by 8 bytes of each."""

    def __init__(self) -> None:
        self._hashes = array("q")

    def add(self, *row: object) -> None:
        self._hashes.append(hash(row))

    @property
    def different(self) -> int:
        return len(np.unique(np.asarray(self._hashes)))


def count_readable_rows(contents: FileBytes) -> int:
    """Counts the rows of our topics, each once, up to the first damage. Raises OSError."""
    topics: dict[int, str] = {}
    rows = _HashedRows()
    with suppress(*DAMAGE):
        for outer in contents.plain_records():
            if isinstance(outer, DataEnd):
                break  # only the summary follows
            for record in split_records(open_chunk(outer)) if isinstance(outer, Chunk) else (outer,):
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Row | Message) and topics.get(record.channel_id) in KIND_OF_TOPIC:
                    rows.add(topics[record.channel_id], record.data)
    return rows.different


def salvage_rows(path: Path, contents: FileBytes, watch: Watch = unwatched) -> Salvage:
    """Finds every row of a file, and counts them; `found_rows` of a new Salvage yields them again.

    Raises OSError, and LogError for a file that never was one of our logs, or that this version cannot decode.
    """
    if contents.find(FOREIGN_SIGNATURE, 0) >= 0:
        raise LogError(
            f"{path}: left as it is: another program has compressed it again, which cannot be recovered here"
        )
    salvage = Salvage(contents)
    salvage.read_head()
    try:
        for _ in salvage.found_rows(watch):
            pass
    except LayoutError as error:
        raise LogError(f"{path}: left as it is: {error}; {OTHER_VERSION}") from None
    if not salvage.rows and not salvage.metadata:
        raise LogError(f"{path}: nothing of a log can be found in it; remove it")
    with suppress(KeyError, ValueError):
        salvage.wall_offset_ns = int(salvage.metadata.pop("wall_minus_monotonic_ns"))
    return salvage


def _find_chunks(contents: FileBytes, watch: Watch) -> Iterator[list[Row | Schema | Channel]]:
    """Yields the records of each sound chunk, in the order of the file."""
    position = 0
    while (signature := contents.find(SIGNATURE, position)) >= 0:
        watch("kB searched", position // 1000, contents.size // 1000)
        position = signature + 1
        start, data = signature - CHUNK_HEAD.size, signature + len(SIGNATURE) + LENGTH.size
        if start < 0 or data > contents.size:
            continue
        head = contents.between(start, data)
        opcode, length, first_ns, last_ns, size, checksum = CHUNK_HEAD.unpack_from(head)
        (compressed,) = LENGTH.unpack_from(head, len(head) - LENGTH.size)
        end = data + compressed
        plausible = opcode == CHUNK_OPCODE and checksum != 0 and size <= LARGEST_CHUNK
        if not plausible or end > contents.size or length != end - start - RECORD_HEAD.size:
            continue
        with suppress(*DAMAGE):
            chunk = Chunk("lz4", contents.between(data, end), last_ns, first_ns, checksum, size)
            yield list(split_records(open_chunk(chunk)))
            position = end
