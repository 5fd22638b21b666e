"""A log as arrays: every row of a file that the recorder wrote, whether or not it was finished.

An MCAP file is a sequence of records, and so is each of its chunks, so one walk serves for both. No index is
needed: a log whose writer was killed is read up to the place where it breaks off. What was damaged rather
than cut off is refused, and the refusal names the place. The ticks become one numpy array laid over the
stored bytes.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import lz4.frame
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Metadata, Schema, Statistics
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from firmware_host.log_rows import CDR_HEADER, EVENT, FORMAT_OF, ROW_KINDS, STRIDE, TICK, RowKind

FRAME = struct.Struct("<BQ")  # of every MCAP record: opcode, length
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; then the row
RECORD_OF: dict[int, Any] = {
    Opcode.CHUNK: Chunk,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.STATISTICS: Statistics,
}


class LogError(ValueError):
    """A log that cannot be read: one sentence with the file, the place and the reason."""


class Log(NamedTuple):
    metadata: dict[str, str]
    configuration_text: str
    ticks: NDArray[np.void]  # fields as in log_rows.TICK
    strides: list[dict[str, Any]]
    events: list[dict[str, Any]]
    complete: bool  # False where the writer was cut off; everything before that is here


def read_log(path: Path) -> Log:
    contents = _read_contents(path)
    found = _Findings()
    for place, opcode, body in _walk(contents, len(MCAP0_MAGIC)):
        try:
            found.add(opcode, body)
        except (ValueError, struct.error, McapError) as error:
            raise LogError(f"{path}: damaged at byte {place}: {error or 'a record ends early'}") from None
    complete = contents.endswith(MCAP0_MAGIC, len(MCAP0_MAGIC))  # not the same one at the beginning
    if complete and not found.everything:
        raise LogError(f"{path}: damaged: only {found.messages} of its rows can be found")
    return Log(
        found.metadata,
        found.configuration_text,
        _tick_array(path, found.rows[TICK]),
        _decode_rows(path, STRIDE, found.rows[STRIDE]),
        _decode_rows(path, EVENT, found.rows[EVENT]),
        complete,
    )


def _read_contents(path: Path) -> bytes:
    try:
        contents = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from None
    if not contents.startswith(MCAP0_MAGIC):
        raise LogError(f"{path}: damaged at byte 0: this is not how an MCAP file begins")
    return contents


def _walk(contents: bytes, place: int = 0) -> Iterator[tuple[int, int, bytes]]:
    """Place, opcode and body of every whole record."""
    while place + FRAME.size <= len(contents):
        opcode, length = FRAME.unpack_from(contents, place)
        start = place + FRAME.size
        if length > len(contents) - start:
            return
        yield place, opcode, contents[start : start + length]
        place = start + length


class _Findings:
    """What the walk through a file has found so far."""

    def __init__(self) -> None:
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.rows: dict[RowKind, list[bytes]] = {kind: [] for kind in ROW_KINDS}
        self.messages = 0
        self.everything = False  # the file's own count was found and agrees
        self._schemas: dict[int, Schema] = {}
        self._rows_of_channel: dict[int, list[bytes]] = {}

    def add(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.MESSAGE:
            self._add_row(body)
        elif opcode == Opcode.ATTACHMENT:
            self._add_attachment(body)
        elif opcode in RECORD_OF:
            self._add_record(RECORD_OF[opcode].read(ReadDataStream(BytesIO(body))))

    def _add_row(self, body: bytes) -> None:
        channel = MESSAGE.unpack_from(body)[0]
        if channel not in self._rows_of_channel:
            raise ValueError(f"a row of channel {channel}, which was not described")
        self._rows_of_channel[channel].append(body[MESSAGE.size :])
        self.messages += 1

    def _add_attachment(self, body: bytes) -> None:
        attachment = Attachment.read(ReadDataStream(BytesIO(body)))
        if zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
            raise ValueError(f"the attachment {attachment.name} does not match its checksum")
        if attachment.name == "configuration.toml":
            self.configuration_text = attachment.data.decode()

    def _add_record(self, record: McapRecord) -> None:
        match record:
            case Chunk():
                for _, opcode, body in _walk(_unpack(record)):
                    self.add(opcode, body)
            case Schema():
                self._schemas[record.id] = record
            case Channel():
                self._rows_of_channel[record.id] = self._rows_for(record)
            case Metadata(name="mudskipper"):
                self.metadata = record.metadata
            case Statistics():
                self.everything = record.message_count == self.messages

    def _rows_for(self, channel: Channel) -> list[bytes]:
        """Where this channel's rows belong; those of a channel that is not ours are not kept."""
        for kind in ROW_KINDS:
            if kind.topic == channel.topic:
                schema = self._schemas.get(channel.schema_id)
                if schema is None or _layout(schema.data.decode()) != _layout(kind.ros_text):
                    raise ValueError(f"rows of {kind.topic} have another layout than this version's")
                return self.rows[kind]
        return []


def _unpack(chunk: Chunk) -> bytes:
    if chunk.compression != "lz4":
        raise ValueError(f"a chunk is compressed by '{chunk.compression}', where only lz4 can be read")
    try:
        contents: bytes = lz4.frame.decompress(chunk.data)
    except (RuntimeError, MemoryError) as error:
        raise ValueError(f"a chunk cannot be decompressed: {error}") from None
    if zlib.crc32(contents) != chunk.uncompressed_crc:
        raise ValueError("a chunk does not match its checksum")
    return contents


def _layout(ros_text: str) -> list[str]:
    """A definition without its comments."""
    return [line.split("#")[0].strip() for line in ros_text.splitlines()]


def tick_type() -> np.dtype[np.void]:
    """The stored bytes of a tick, behind their encapsulation, as numpy sees them."""
    formats = [np.dtype((f"<{FORMAT_OF[f.kind]}", (f.count,) if f.count > 1 else ())) for f in TICK.fields]
    ends = np.cumsum([len(CDR_HEADER), *(format.itemsize for format in formats)])
    return np.dtype(
        {
            "names": [field.name for field in TICK.fields],
            "formats": formats,
            "offsets": ends[:-1].tolist(),
            "itemsize": TICK.layout.size,
        }
    )


def _tick_array(path: Path, rows: list[bytes]) -> NDArray[np.void]:
    for number, row in enumerate(rows, 1):
        if len(row) != TICK.layout.size:
            raise LogError(f"{path}: row {number} of /tick has {len(row)} bytes, not {TICK.layout.size}")
    return np.frombuffer(b"".join(rows), dtype=tick_type())


def _decode_rows(path: Path, kind: RowKind, rows: list[bytes]) -> list[dict[str, Any]]:
    decoded = []
    for number, row in enumerate(rows, 1):
        try:
            decoded.append(kind.decode(row))
        except struct.error as error:
            raise LogError(f"{path}: row {number} of {kind.topic} is damaged: {error}") from None
    return decoded


def log_summary(log: Log) -> dict[str, str | int | float | bool]:
    """What a log is about, in a few plain values."""
    stamps_s = log.ticks["stamp_s"]
    duration_s = float(stamps_s[-1] - stamps_s[0]) if len(stamps_s) else 0.0
    return {
        "robot": log.metadata.get("robot", ""),
        "started": _start_time(log),
        "duration_s": duration_s,
        "ticks": len(stamps_s),
        "missed_ticks": int(log.ticks["missed_ticks"][-1]) if len(stamps_s) else 0,
        "rate_hz": (len(stamps_s) - 1) / duration_s if duration_s > 0.0 else 0.0,
        "strides": len(log.strides),
        "events": len(log.events),
        "complete": log.complete,
    }


def _start_time(log: Log) -> str:
    """Universal time of the first row, to the second; empty where there is none."""
    stamps_s = [*log.ticks["stamp_s"][:1], *(row["stamp_s"] for row in (*log.strides[:1], *log.events[:1]))]
    if not stamps_s or "wall_minus_monotonic_ns" not in log.metadata:
        return ""
    wall_s = min(stamps_s) + int(log.metadata["wall_minus_monotonic_ns"]) / 1e9
    return datetime.fromtimestamp(wall_s, UTC).isoformat(timespec="seconds")
