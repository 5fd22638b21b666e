"""A log as arrays: every row of a file that the recorder wrote, whether or not it was finished.

The records are read in order, without the index at the end, so a log whose writer was killed is read up to the
place where it breaks off. What was damaged rather than cut off is refused, and the refusal names the place. The
ticks become one numpy array laid over the stored bytes.
"""

from __future__ import annotations

import struct
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.exceptions import EndOfFile, McapError, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from firmware_host.log_rows import CDR_HEADER, EVENT, FORMAT_OF, ROW_KINDS, STRIDE, TICK, RowKind


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
    stream, found = BytesIO(contents), _Findings()
    try:
        for record in StreamReader(stream, validate_crcs=True, record_size_limit=len(contents)).records:
            found.add(record)
        complete = True
    except (McapError, ValueError, RuntimeError, MemoryError, struct.error) as error:
        finished = len(contents) > len(MCAP0_MAGIC) and contents.endswith(MCAP0_MAGIC)
        if finished or not _is_cut(error, stream.tell() == len(contents)):
            raise LogError(f"{path}: damaged before byte {stream.tell()}: {error}") from None
        complete = False
    if complete and found.messages != found.messages_promised:
        raise LogError(f"{path}: damaged: only {found.messages} of its {found.messages_promised} rows can be found")
    return Log(
        found.metadata,
        found.configuration_text,
        _tick_array(path, found.rows[TICK]),
        _decode_rows(path, STRIDE, found.rows[STRIDE]),
        _decode_rows(path, EVENT, found.rows[EVENT]),
        complete,
    )


def _is_cut(error: Exception, at_the_end: bool) -> bool:
    """Whether a file just ends where a record should go on: the writer was killed."""
    return isinstance(error, EndOfFile | RecordLengthLimitExceeded) or (isinstance(error, struct.error) and at_the_end)


def _read_contents(path: Path) -> bytes:
    try:
        contents = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from None
    if not contents.startswith(MCAP0_MAGIC):
        raise LogError(f"{path}: damaged at byte 0: this is not how an MCAP file begins")
    return contents


class _Findings:
    """What the records read so far have said."""

    def __init__(self) -> None:
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.rows: dict[RowKind, list[bytes]] = {kind: [] for kind in ROW_KINDS}
        self.messages = self.messages_promised = 0
        self._schemas: dict[int, Schema] = {}
        self._rows_of_channel: dict[int, list[bytes]] = {}

    def add(self, record: McapRecord) -> None:
        match record:
            case Message():
                self._add_row(record)
            case Schema():
                self._schemas[record.id] = record
            case Channel():
                self._rows_of_channel[record.id] = self._rows_for(record)
            case Attachment(name="configuration.toml"):
                self.configuration_text = record.data.decode()
            case Metadata(name="mudskipper"):
                self.metadata = record.metadata
            case Statistics():
                self.messages_promised = record.message_count

    def _add_row(self, message: Message) -> None:
        if message.channel_id not in self._rows_of_channel:
            raise ValueError(f"a row of channel {message.channel_id}, which was not described")
        self._rows_of_channel[message.channel_id].append(message.data)
        self.messages += 1

    def _rows_for(self, channel: Channel) -> list[bytes]:
        """Where this channel's rows belong; those of a channel that is not ours are not kept."""
        for kind in ROW_KINDS:
            if kind.topic == channel.topic:
                schema = self._schemas.get(channel.schema_id)
                if schema is None or _layout(schema.data.decode()) != _layout(kind.ros_text):
                    raise ValueError(f"rows of {kind.topic} have another layout than this version's")
                return self.rows[kind]
        return []


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
