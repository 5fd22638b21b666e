"""Finds every row of a damaged log that a checksum still confirms, at any position in the file.

The chunks are found by their signature anywhere in the file, so damage in the middle costs only the rows that it
touches. A row that is found twice counts once. The gaps in each channel's sequence numbers are the lost rows. The rows
keep the layout that the file describes; where the description is lost, they are taken to have that of this version.
"""

import struct
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from math import isfinite
from pathlib import Path

from mcap.records import Attachment, Channel, Chunk, DataEnd, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from firmware_host.log.log_file import ATTACHMENT, METADATA
from firmware_host.log.rows import EVENT_KIND, ROW_KINDS
from firmware_host.log.schema import LayoutError
from firmware_host.log_reading.chunks import RECORD_HEAD, Row, open_chunk, split_records
from firmware_host.log_reading.file_pass import KIND_OF_TOPIC, OTHER_VERSION, described_kind
from firmware_host.log_reading.log_error import DAMAGE, LogError, Watch, unwatched

SIGNATURE = struct.pack("<I", 3) + b"lz4"  # in the head of each of our chunks, after CHUNK_HEAD
FOREIGN_SIGNATURE = struct.pack("<I", 4) + b"zstd"
CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size and checksum of the contents
LENGTH = struct.Struct("<Q")
CHUNK_OPCODE = 6
LARGEST_CHUNK = 16 << 20  # bytes, when opened


class Salvage:
    """Everything that a damaged file still holds. Owns the layouts and the sequence numbers of its rows."""

    def __init__(self) -> None:
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.kinds = list(ROW_KINDS)  # as the file describes them
        self.rows: list[tuple[int, bytes]] = []  # number of the kind, encoded row
        self.wall_offset_ns = 0
        self.ended = False  # the writer finished the file
        self._number_of_channel = {number + 1: number for number in range(len(ROW_KINDS))}  # as LogFile numbers them
        self._schemas: dict[int, Schema] = {}
        self._sequences: list[set[int]] = [set() for _ in ROW_KINDS]
        self._foreign: set[tuple[int, int, int]] = set()

    @property
    def last_stamp_s(self) -> float:
        number, row = self.rows[-1] if self.rows else (EVENT_KIND, b"")
        stamp_s = self.kinds[number].stamp_s(row)
        return stamp_s if isfinite(stamp_s) else 0.0

    @property
    def lost(self) -> int:
        """Rows whose numbers are missing before the last one found."""
        return sum(max(found) + 1 - len(found) for found in self._sequences if found)

    @property
    def foreign(self) -> int:
        """Rows of unknown topics."""
        return len(self._foreign)

    def read_head(self, contents: bytes) -> None:
        """Reads the metadata and the configuration, which precede the first chunk, as far as they can be read."""
        reader = StreamReader(BytesIO(contents), emit_chunks=True, record_size_limit=len(contents))
        with suppress(*DAMAGE):
            for record in reader.records:
                match record:
                    case Metadata(name=name) if name == METADATA:
                        self.metadata = dict(record.metadata)
                    case Attachment(name=name) if name == ATTACHMENT:
                        self.configuration_text = record.data.decode()
                    case Chunk():
                        break

    def add(self, record: Row | Schema | Channel) -> None:
        """Raises LayoutError."""
        match record:
            case Row():
                self._add_row(record)
            case Schema():
                self._schemas[record.id] = record
            case Channel():
                self._number_of_channel.pop(record.id, None)
                number = KIND_OF_TOPIC.get(record.topic)
                if number is not None:
                    self.kinds[number] = described_kind(number, self._schemas.get(record.schema_id))
                    self._number_of_channel[record.id] = number

    def _add_row(self, row: Row) -> None:
        number = self._number_of_channel.get(row.channel_id)
        if number is None:
            self._foreign.add((row.channel_id, row.sequence, hash(row.data)))
            return
        if row.sequence in self._sequences[number] or not self.kinds[number].fits(row.data):
            return
        if not self.rows:
            with suppress(ValueError, OverflowError):  # of a stamp that is not finite
                self.wall_offset_ns = row.log_time_ns - round(self.kinds[number].stamp_s(row.data) * 1e9)
        self._sequences[number].add(row.sequence)
        self.rows.append((number, row.data))


def count_readable_rows(contents: bytes) -> int:
    """Counts the rows of our topics, each once, up to the first damage."""
    topics: dict[int, str] = {}
    rows: set[tuple[str, int]] = set()
    reader = StreamReader(BytesIO(contents), emit_chunks=True, record_size_limit=len(contents))
    with suppress(*DAMAGE):
        for outer in reader.records:
            if isinstance(outer, DataEnd):
                break  # only the summary follows
            for record in split_records(open_chunk(outer)) if isinstance(outer, Chunk) else (outer,):
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Row | Message) and topics.get(record.channel_id) in KIND_OF_TOPIC:
                    rows.add((topics[record.channel_id], hash(record.data)))
    return len(rows)


def salvage_rows(path: Path, contents: bytes, watch: Watch = unwatched) -> Salvage:
    """Raises LogError for a file that never was one of our logs, or that this version cannot decode."""
    if FOREIGN_SIGNATURE in contents:
        raise LogError(
            f"{path}: left as it is: another program has compressed it again, which cannot be recovered here"
        )
    salvage = Salvage()
    if contents.startswith(MCAP0_MAGIC):
        salvage.read_head(contents)
    try:
        for chunk in _find_chunks(contents, watch):
            for record in chunk:
                salvage.add(record)
    except LayoutError as error:
        raise LogError(f"{path}: left as it is: {error}; {OTHER_VERSION}") from None
    if not salvage.rows and not salvage.metadata:
        raise LogError(f"{path}: nothing of a log can be found in it; remove it")
    with suppress(KeyError, ValueError):
        salvage.wall_offset_ns = int(salvage.metadata.pop("wall_minus_monotonic_ns"))
    salvage.ended = contents.endswith(MCAP0_MAGIC) and len(contents) > len(MCAP0_MAGIC)
    return salvage


def _find_chunks(contents: bytes, watch: Watch) -> Iterator[list[Row | Schema | Channel]]:
    """Yields the records of each sound chunk, in the order of the file."""
    position = 0
    while (signature := contents.find(SIGNATURE, position)) >= 0:
        watch("kB searched", position // 1000, len(contents) // 1000)
        position = signature + 1
        start, data = signature - CHUNK_HEAD.size, signature + len(SIGNATURE) + LENGTH.size
        if start < 0 or data > len(contents):
            continue
        opcode, length, first_ns, last_ns, size, checksum = CHUNK_HEAD.unpack_from(contents, start)
        (compressed,) = LENGTH.unpack_from(contents, data - LENGTH.size)
        end = data + compressed
        plausible = opcode == CHUNK_OPCODE and checksum != 0 and size <= LARGEST_CHUNK
        if not plausible or end > len(contents) or length != end - start - RECORD_HEAD.size:
            continue
        with suppress(*DAMAGE):
            chunk = Chunk("lz4", contents[data:end], last_ns, first_ns, checksum, size)
            yield list(split_records(open_chunk(chunk)))
            position = end
