"""One pass over an MCAP file, whether or not its writer finished it: its rows in their order, and all the rest.

The records are read by their lengths, without the index at the end, so a log whose writer was killed is read up to the
byte where it ends. A pass reads what the file held when it, or an earlier pass, began: a file that grows meanwhile
looks cut off there. A damaged file is refused, and the refusal names the byte. A pass that salvages skips what is
damaged instead, by its length, and ends where a length itself is damaged. Rows have the schema that the file carries
(schema.py), so logs of older and newer versions are read. At any time one chunk is in memory.
"""

import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema, Statistics
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from control.records import FLIPPERS
from firmware_host.log.log_file import ANNOTATION, ATTACHMENT, METADATA
from firmware_host.log.log_folder import present_path
from firmware_host.log.rows import EVENT_KIND, ROW_KINDS, STRIDE_KIND, TICK, TICK_KIND, rig_of, row_kinds
from firmware_host.log.schema import LayoutError, RowKind, read_definition
from logs.files.chunks import RECORD_HEAD, Messages, Record, open_chunk, split_records
from logs.files.expansion import Expansion
from logs.files.log_error import ADVICE, DAMAGE, LogError, Watch, unwatched
from logs.files.stored_logs import why_not_read

OTHER_VERSION = "read it with the version of mudskipper that wrote it"
KIND_OF_TOPIC = {kind.topic: number for number, kind in enumerate(ROW_KINDS)}

StoredTicks = NDArray[np.void]  # whole rows as the file has them, not yet divided into fields
Spans = Sequence[tuple[float, float]]  # from one time to another, by the robot's clock
EVERYTHING: Spans = ((-inf, inf),)


class FilePass:
    """Owns what a pass has found so far; `ticks` makes the pass, or `rows`, which a pass that salvages uses."""

    def __init__(self, path: Path, size: int | None = None, spans: Spans = EVERYTHING, salvages: bool = False) -> None:
        """`size` ends the pass before the file's end. Of the rows outside all spans it reads only the first chunk."""
        self.path, self.size, self._spans, self._salvages = path, size, spans, salvages
        self.complete = False  # whether the records reach the file's end; of a pass that salvages: the end of the rows
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        # As the file describes them, by their number in ROW_KINDS. Rows without a description are salvaged as those of
        # this version, whose channels LogFile numbers from 1.
        self.kinds: dict[int, RowKind] = dict(enumerate(ROW_KINDS)) if salvages else {}
        self._number_of_channel: dict[int, int | None] = {number + 1: number for number in self.kinds}
        self._schemas: dict[int, Schema] = {}
        self._chunks = set[tuple[int, int, int]]()  # that were salvaged: a piece of a file may be in it twice
        self.messages = self.messages_counted = 0
        self._ticks = self._position = 0
        self._misfit = ""  # the first row that is not as long as its description says
        self._encoded: dict[int, list[bytes]] = {STRIDE_KIND: [], EVENT_KIND: []}

    @property
    def tick_kind(self) -> RowKind:
        return self.kinds.get(TICK_KIND, TICK)

    def ticks(self, watch: Watch = unwatched) -> Iterator[StoredTicks]:
        """Yield the ticks in the order of the file. Raises LogError for a damaged or unreadable file."""
        try:
            with present_path(self.path).open("rb") as file:
                for number, messages in self.rows(file, watch):
                    self.messages += len(messages)
                    if number == TICK_KIND:
                        yield from self._fitting(messages["row"])
                    elif number is not None:
                        self._encoded[number] += [row.tobytes() for row in messages["row"]]
        except OSError as error:
            raise LogError(why_not_read(self.path, error)) from None
        except LayoutError as error:
            raise LogError(f"{self.path}: {error}; {OTHER_VERSION}") from None
        except LogError:
            raise
        except DAMAGE as error:
            raise LogError(f"{self.path}: damaged before byte {self._position}: {error}; {ADVICE}") from None

    def _fitting(self, rows: StoredTicks) -> Iterator[StoredTicks]:
        found, expected = rows.dtype.itemsize, self.tick_kind.layout.size
        if found == expected:
            yield rows
        elif not self._misfit:
            self._misfit = f"row {self._ticks + 1} of {self.tick_kind.topic} has {found} bytes, not {expected}"
        self._ticks += len(rows)

    def rows(self, file: BinaryIO, watch: Watch = unwatched) -> Iterator[tuple[int | None, Messages]]:
        """Yield the rows with the number of their kind; None for those of an unknown topic, which are only counted.

        Raises OSError, LayoutError, LogError, and DAMAGE unless the pass salvages.
        """
        for opcode, contents in self._records(file, watch):
            try:
                records = self._read(opcode, contents)
            except DAMAGE:
                if not self._salvages:
                    raise
                continue
            for record in records:
                if isinstance(record, Schema):
                    self._schemas[record.id] = record
                elif isinstance(record, Channel):
                    self._add_channel(record, opcode == Opcode.CHUNK)
                else:
                    yield self._number_of(int(record["channel"][0])), record

    def _records(self, file: BinaryIO, watch: Watch) -> Iterator[tuple[int, bytes]]:
        """Yield opcode and contents of each record, up to the footer or to a length that reaches beyond the file."""
        descriptor, present = file.fileno(), os.fstat(file.fileno()).st_size
        self.size = size = present if self.size is None else min(self.size, present)
        self._expansion = Expansion(self.path, size)
        if not self._salvages and os.pread(descriptor, len(MCAP0_MAGIC), 0) != MCAP0_MAGIC:
            raise LogError(f"{self.path}: damaged at byte 0: this is not how an MCAP file begins")
        position, opcode = len(MCAP0_MAGIC), 0
        while (
            opcode != Opcode.FOOTER
            and len(head := os.pread(descriptor, RECORD_HEAD.size, position)) == RECORD_HEAD.size
        ):
            opcode, length = RECORD_HEAD.unpack(head)
            position += RECORD_HEAD.size
            contents = os.pread(descriptor, length, position) if position + length <= size else b""
            self.complete = self._salvages and opcode == Opcode.DATA_END
            if not opcode or self.complete or len(contents) < length or position > size:
                break
            position += length
            self._position = position
            watch("kB read", position // 1000, size // 1000)
            yield opcode, contents
        has_end = (
            size > len(MCAP0_MAGIC) and os.pread(descriptor, len(MCAP0_MAGIC), size - len(MCAP0_MAGIC)) == MCAP0_MAGIC
        )
        if not self._salvages and has_end:
            self.complete = opcode == Opcode.FOOTER and position + len(MCAP0_MAGIC) == size
            if not self.complete:
                raise ValueError("a record does not end where the next one begins")

    def _read(self, opcode: int, contents: bytes) -> list[Record]:
        """Return the records of a chunk, or what stands outside of one. Raises DAMAGE, and LogError."""
        stream = ReadDataStream(BytesIO(contents))
        match opcode:
            case Opcode.CHUNK:
                return self._read_chunk(Chunk.read(stream))
            case Opcode.ATTACHMENT if (attachment := Attachment.read(stream)).name == ATTACHMENT:
                self.configuration_text = attachment.data.decode()
            case Opcode.METADATA if (metadata := Metadata.read(stream)).name in (METADATA, ANNOTATION):
                self.metadata = self.metadata | metadata.metadata
            case Opcode.STATISTICS:
                self.messages_counted = Statistics.read(stream).message_count
            case Opcode.SCHEMA | Opcode.CHANNEL | Opcode.MESSAGE if (
                not self._salvages
            ):  # no checksum has confirmed them
                return list(split_records(RECORD_HEAD.pack(opcode, len(contents)) + contents))
        return []

    def _read_chunk(self, chunk: Chunk) -> list[Record]:
        key = chunk.uncompressed_crc, chunk.uncompressed_size, chunk.message_start_time
        if not self._is_wanted(chunk) or key in self._chunks:
            return []
        contents = open_chunk(chunk)
        self._expansion.add(len(contents))
        records = list(split_records(contents))
        if self._salvages:
            self._chunks.add(key)
        return records

    def _is_wanted(self, chunk: Chunk) -> bool:
        """Whether some span has rows of the chunk; the first chunk, which describes the channels, always is."""
        if self._spans is EVERYTHING or not self._number_of_channel:
            return True
        offset_ns = int(self.metadata.get("wall_minus_monotonic_ns", "0"))
        first_ns, last_ns = chunk.message_start_time - offset_ns, chunk.message_end_time - offset_ns
        return any(last_ns >= 1e9 * from_s and first_ns <= 1e9 * to_s for from_s, to_s in self._spans)

    def _number_of(self, channel_id: int) -> int | None:
        if not self._salvages and channel_id not in self._number_of_channel:
            raise ValueError(f"a row of channel {channel_id}, which was not described")
        return self._number_of_channel.get(channel_id)

    def _add_channel(self, channel: Channel, in_chunk: bool) -> None:
        """A layout outside of a chunk, which no checksum has confirmed, may be damage."""
        number = self._number_of_channel[channel.id] = KIND_OF_TOPIC.get(channel.topic)
        if number is None:
            return
        try:
            kind = described_kind(number, self._schemas.get(channel.schema_id), channel.metadata)
        except LayoutError as error:
            raise error if in_chunk else ValueError(str(error)) from None
        if self._salvages:
            self.kinds[number] = kind
        elif self.kinds.setdefault(number, kind).definition != kind.definition:
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


def described_kind(number: int, schema: Schema | None, metadata: Mapping[str, str]) -> RowKind:
    """Return the row kind of one of our topics as a file describes it. Raises LayoutError."""
    if schema is None:
        raise LayoutError(f"{ROW_KINDS[number].topic} is not described")
    definition = schema.data.decode(errors="replace")
    # A log of version 0.2 names the joints of its flippers in comments, before they were metadata.
    commented = " ".join(flipper for flipper in FLIPPERS if f"{flipper} sweep" in definition)
    return read_definition(row_kinds(rig_of({"flippers": commented, **metadata}))[number], definition)


def _field_names(kinds: Mapping[int, RowKind]) -> list[str]:
    return [f"{kind.topic} {field.name}" for kind in kinds.values() for field in kind.fields]
