"""One pass over an MCAP file, whether or not its writer finished it: its ticks in pieces, then all the rest.

The records are read in order, without the index at the end, so a log whose writer was killed is read up to the byte
where it ends. A pass reads what the file held when it, or an earlier pass, began: a file that grows meanwhile looks cut
off there. A damaged file is refused, and the refusal names the byte. Rows have the schema that the file carries
(schema.py), so logs of older and newer versions are read. At any time one chunk is in memory.
"""

import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from control.records import FLIPPERS
from firmware_host.log.log_file import ANNOTATION, ATTACHMENT, METADATA
from firmware_host.log.log_folder import present_path
from firmware_host.log.rows import EVENT_KIND, ROW_KINDS, STRIDE_KIND, TICK, TICK_KIND, rig_of, row_kinds
from firmware_host.log.schema import LayoutError, RowKind, read_definition
from logs.files.chunks import RECORD_HEAD, Record, Row, open_chunk, record_at, run_of_rows
from logs.files.expansion import Expansion
from logs.files.log_error import ADVICE, DAMAGE, LogError, Watch, unwatched
from logs.files.stored_logs import why_not_read

OTHER_VERSION = "read it with the version of mudskipper that wrote it"
KIND_OF_TOPIC = {kind.topic: number for number, kind in enumerate(ROW_KINDS)}

StoredTicks = NDArray[np.void]  # whole rows as the file has them, not yet divided into fields
Spans = Sequence[tuple[float, float]]  # from one time to another, by the robot's clock
EVERYTHING: Spans = ((-inf, inf),)


class FilePass:
    """Owns what a pass has found so far; `ticks` makes the pass."""

    def __init__(self, path: Path, size: int | None = None, spans: Spans = EVERYTHING) -> None:
        """`size` ends the pass before the file's end. Of the rows outside all spans it reads only the first chunk."""
        self.path, self.size, self._spans = path, size, spans
        self.complete = False  # whether the records reach the file's end
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.kinds: dict[int, RowKind] = {}  # as the file describes them, by their number in ROW_KINDS
        self.messages = self.messages_counted = 0
        self._ticks = 0
        self._expansion = Expansion(path, 0)
        self._misfit = ""  # the first row that is not as long as its description says
        self._encoded: dict[int, list[bytes]] = {STRIDE_KIND: [], EVENT_KIND: []}
        self._schemas: dict[int, Schema] = {}
        self._number_of_channel: dict[int, int | None] = {}  # None: an unknown topic, whose rows are only counted

    @property
    def tick_kind(self) -> RowKind:
        return self.kinds.get(TICK_KIND, TICK)

    def ticks(self, watch: Watch = unwatched) -> Iterator[StoredTicks]:
        """Yield the ticks in the order of the file. Raises LogError for a damaged or unreadable file."""
        try:
            with present_path(self.path).open("rb") as file:
                stream = _Beginning(file, self.size)
                self.size = stream.size
                self._expansion = Expansion(self.path, stream.size)
                yield from self._read(stream, watch)
        except OSError as error:
            raise LogError(why_not_read(self.path, error)) from None

    def _read(self, stream: "_Beginning", watch: Watch) -> Iterator[StoredTicks]:
        if not stream.begins_as_mcap:
            raise LogError(f"{self.path}: damaged at byte 0: this is not how an MCAP file begins")
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=stream.size)  # type: ignore[arg-type]
        try:
            for record in reader.records:
                yield from self._add(record)
                watch("kB read", stream.position // 1000, stream.size // 1000)
        except LayoutError as error:
            raise LogError(f"{self.path}: {error}; {OTHER_VERSION}") from None
        except LogError:
            raise
        except DAMAGE as error:
            if stream.ends_as_mcap or not _is_cut(error, stream.position == stream.size):
                raise LogError(f"{self.path}: damaged before byte {stream.position}: {error}; {ADVICE}") from None
            return
        self.complete = True

    def _add(self, record: McapRecord | Record, checked: bool = False) -> Iterator[StoredTicks]:
        """`checked` is whether a checksum has confirmed the record. Raises LayoutError, LogError, and DAMAGE."""
        match record:
            case Row() | Message():
                yield from self._add_row(record.channel_id, record.data)
            case Chunk() if not self._is_wanted(record):
                return
            case Chunk():
                contents = open_chunk(record)
                self._expansion.add(len(contents))
                yield from self._add_chunk(contents, bool(record.uncompressed_crc))
            case Schema():
                self._schemas[record.id] = record
            case Channel():
                self._add_channel(record, checked)
            case Attachment(name=name) if name == ATTACHMENT:
                self.configuration_text = record.data.decode()
            case Metadata(name=name) if name == METADATA:
                self.metadata = record.metadata
            case Metadata(name=name) if name == ANNOTATION:
                self.metadata = self.metadata | record.metadata
            case Statistics():
                self.messages_counted = record.message_count

    def _is_wanted(self, chunk: Chunk) -> bool:
        """Whether some span has rows of the chunk; the first chunk, which describes the channels, always is."""
        if self._spans is EVERYTHING or not self._number_of_channel:
            return True
        offset_ns = int(self.metadata.get("wall_minus_monotonic_ns", "0"))
        first_ns, last_ns = chunk.message_start_time - offset_ns, chunk.message_end_time - offset_ns
        return any(last_ns >= 1e9 * from_s and first_ns <= 1e9 * to_s for from_s, to_s in self._spans)

    def _add_chunk(self, contents: bytes, checked: bool) -> Iterator[StoredTicks]:
        position = 0
        while position < len(contents):
            run = self._run_of_ticks(contents, position)
            if run is not None and len(run):
                position += run.strides[0] * len(run)
                self.messages += len(run)
                self._ticks += len(run)
                yield run
                continue
            record, position = record_at(contents, position)
            if record is not None:
                yield from self._add(record, checked)

    def _run_of_ticks(self, contents: bytes, position: int) -> StoredTicks | None:
        opcode, _ = RECORD_HEAD.unpack_from(contents, position)
        if opcode != Opcode.MESSAGE or TICK_KIND not in self.kinds:
            return None
        (channel_id,) = struct.unpack_from("<H", contents, position + RECORD_HEAD.size)
        if self._number_of_channel.get(channel_id) != TICK_KIND:
            return None
        return run_of_rows(contents, position, channel_id, self.tick_kind.layout.size)

    def _add_row(self, channel_id: int, row: bytes) -> Iterator[StoredTicks]:
        if channel_id not in self._number_of_channel:
            raise ValueError(f"a row of channel {channel_id}, which was not described")
        number = self._number_of_channel[channel_id]
        self.messages += 1
        if number == TICK_KIND:
            yield from self._add_tick(row)
        elif number is not None:
            self._encoded[number].append(row)

    def _add_tick(self, row: bytes) -> Iterator[StoredTicks]:
        self._ticks += 1
        kind = self.tick_kind
        if kind.fits(row):
            yield np.frombuffer(row, f"V{kind.layout.size}", 1)
        elif not self._misfit:
            self._misfit = f"row {self._ticks} of {kind.topic} has {len(row)} bytes, not {kind.layout.size}"

    def _add_channel(self, channel: Channel, checked: bool) -> None:
        """A layout that no checksum has confirmed may be damage."""
        number = KIND_OF_TOPIC.get(channel.topic)
        self._number_of_channel[channel.id] = number
        if number is None:
            return
        try:
            kind = described_kind(number, self._schemas.get(channel.schema_id), channel.metadata)
        except LayoutError as error:
            raise error if checked else ValueError(str(error)) from None
        if self.kinds.setdefault(number, kind).definition != kind.definition:
            raise ValueError(f"{channel.topic} is described twice, differently")

    def require_all_rows(self) -> None:
        """Raises LogError where a finished file has fewer rows than it counts, or a row has a wrong length."""
        if self.complete and self._spans is EVERYTHING and self.messages != self.messages_counted:
            found = f"only {self.messages} of its {self.messages_counted} rows can be found"
            raise LogError(f"{self.path}: damaged: {found}; {ADVICE}")
        if self._misfit:
            raise LogError(f"{self.path}: {self._misfit}")

    def decoded(self, number: int) -> list[dict[str, Any]]:
        """Return the strides or the events. Raises LogError."""
        own = ROW_KINDS[number]
        kind = self.kinds.get(number, own)
        missing = {field.name: field.missing for field in own.fields}
        rows = []
        for count, row in enumerate(self._encoded[number], 1):
            try:
                rows.append(missing | kind.decode(row))
            except struct.error as error:
                raise LogError(f"{self.path}: row {count} of {kind.topic} is damaged: {error}") from None
        return rows

    def unknown_fields(self) -> tuple[str, ...]:
        own = _field_names(dict(enumerate(ROW_KINDS)))
        return tuple(name for name in _field_names(self.kinds) if name not in own)

    def missing_fields(self) -> tuple[str, ...]:
        present = _field_names(self.kinds)
        described = _field_names({number: ROW_KINDS[number] for number in self.kinds})
        return tuple(name for name in described if name not in present)


class _Beginning:
    """The first `size` bytes of a file as a stream; owns the position in it."""

    def __init__(self, file: BinaryIO, size: int | None) -> None:
        present = os.fstat(file.fileno()).st_size
        self.size = present if size is None else min(size, present)
        self.begins_as_mcap = file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC and self.size >= len(MCAP0_MAGIC)
        file.seek(max(0, self.size - len(MCAP0_MAGIC)))
        self.ends_as_mcap = file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC and self.size > len(MCAP0_MAGIC)
        file.seek(0)
        self.position = 0
        self._file = file

    def read(self, length: int) -> bytes:
        wanted = min(length, self.size - self.position)
        piece = self._file.read(wanted)
        self.position += len(piece)
        if len(piece) < wanted:  # the file was cut off meanwhile
            self.size, self.ends_as_mcap = self.position, False
        return piece


def _is_cut(error: Exception, at_the_end: bool) -> bool:
    """Whether the file ends where a record should continue, because the writer was killed."""
    return isinstance(error, EndOfFile | RecordLengthLimitExceeded) or (isinstance(error, struct.error) and at_the_end)


def described_kind(number: int, schema: Schema | None, metadata: Mapping[str, str]) -> RowKind:
    """Return the row kind of one of our topics as a file describes it. Raises LayoutError."""
    if schema is None:
        raise LayoutError(f"{ROW_KINDS[number].topic} is not described")
    definition = schema.data.decode(errors="replace")
    rig = rig_of(metadata if "flippers" in metadata else {"flippers": _flippers_of_comments(definition)})
    return read_definition(row_kinds(rig)[number], definition)


def _flippers_of_comments(definition: str) -> str:
    """Return the flippers whose joints the comments of a log of version 0.2 name, before they were metadata."""
    return " ".join(flipper for flipper in FLIPPERS if f"{flipper} sweep" in definition)


def _field_names(kinds: Mapping[int, RowKind]) -> list[str]:
    return [f"{kind.topic} {field.name}" for kind in kinds.values() for field in kind.fields]
