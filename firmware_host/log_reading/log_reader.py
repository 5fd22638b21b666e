"""A log as arrays: every row of a file that the recorder wrote, whether or not it was finished.

The records are read in order, without the index at the end, so a log whose writer was killed is read up to the
place where it breaks off. What was damaged rather than cut off is refused, and the refusal names the place. The
ticks become one numpy array laid over the stored bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.exceptions import EndOfFile, McapError, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from firmware_host.log.chunks import Row, open_chunk, records_of
from firmware_host.log.log_folder import why_not_read
from firmware_host.log.rows import CDR_HEADER, EVENT, FORMAT_OF, ROW_KINDS, STRIDE, TICK, RowKind

DAMAGE = (McapError, ValueError, RuntimeError, OverflowError, MemoryError, struct.error)  # what reading it may raise


ADVICE = "'mudskipper log recover' keeps what is sound"
OTHER_VERSION = "the version that wrote it reads it"


class LogError(ValueError):
    """A log that cannot be read: one sentence with the file, the place and the reason."""


class LayoutError(LogError):
    """A sound log of another version of this program."""


class Log(NamedTuple):
    metadata: dict[str, str]
    configuration_text: str
    ticks: NDArray[np.void]  # fields as in log_rows.TICK
    strides: list[dict[str, Any]]
    events: list[dict[str, Any]]
    complete: bool  # False where the writer was cut off; everything before that is here


Watch = Callable[[str, int, int], None]  # hears what is done, how far, of how much


def unwatched(what: str, done: int, total: int) -> None:
    """Nobody waits for it."""


def read_log(path: Path, watch: Watch = unwatched, from_s: float = -inf) -> Log:
    """Of what is before `from_s` only as much as its first chunk holds. Raises LogError."""
    contents = _read_contents(path)
    found = _Findings(from_s)
    complete = _read_records(path, contents, found, watch)
    if complete and from_s == -inf and found.messages != found.messages_promised:
        raise LogError(
            f"{path}: damaged: only {found.messages} of its {found.messages_promised} rows can be found; {ADVICE}"
        )
    return Log(
        found.metadata,
        found.configuration_text,
        _in_order(_tick_array(path, found.rows[TICK])),
        _decode_rows(path, STRIDE, found.rows[STRIDE]),
        _decode_rows(path, EVENT, found.rows[EVENT]),
        complete,
    )


def _read_records(path: Path, contents: bytes, found: _Findings, watch: Watch) -> bool:
    """Whether they go on to the file's end: a log may be cut off. Raises LogError for one that is damaged."""
    stream = BytesIO(contents)
    reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=len(contents))
    try:
        for record in reader.records:
            found.add(record)
            watch("kB read", stream.tell() // 1000, len(contents) // 1000)
    except LayoutError as error:
        raise LayoutError(f"{path}: {error}; {OTHER_VERSION}") from None
    except DAMAGE as error:
        finished = len(contents) > len(MCAP0_MAGIC) and contents.endswith(MCAP0_MAGIC)
        if finished or not _is_cut(error, stream.tell() == len(contents)):
            raise LogError(f"{path}: damaged before byte {stream.tell()}: {error}; {ADVICE}") from None
        return False
    return True


def read_logs(paths: Sequence[Path], watch: Watch = unwatched, from_s: float = -inf) -> Log:
    """One log, or several segments of one run as one. Raises LogError, also where a segment between them is missing."""
    logs = [read_log(path, watch, from_s) for path in paths]
    if len(logs) == 1:
        return logs[0]
    if len({log.metadata.get("run_id") for log in logs}) > 1 or "run_id" not in logs[0].metadata:
        raise LogError(f"{paths[0]}: not of one run with the others; read each alone")
    try:
        by_number = sorted((int(log.metadata["segment"]), place) for place, log in enumerate(logs))
    except (KeyError, ValueError):
        raise LogError(f"{paths[0]}: the segments of its run are not numbered; read each alone") from None
    numbers = [number for number, _ in by_number]
    if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        raise LogError(f"{paths[0]}: {_why_not_joined(numbers)}")
    ordered = [logs[place] for _, place in by_number]
    return ordered[0]._replace(
        ticks=_in_order(np.frombuffer(b"".join(log.ticks.tobytes() for log in ordered), dtype=tick_type())),
        strides=[stride for log in ordered for stride in log.strides],
        events=[event for log in ordered for event in log.events],
        complete=all(log.complete for log in ordered),
    )


def _why_not_joined(numbers: list[int]) -> str:
    missing = sorted(set(range(numbers[0], numbers[-1])) - set(numbers))
    twice = sorted({number for number in numbers if numbers.count(number) > 1})
    wrong = [f"{', '.join(map(str, missing[:20]))} missing"] * bool(missing)
    wrong += [f"{', '.join(map(str, twice[:20]))} given twice"] * bool(twice)
    return f"segments {numbers[0]} to {numbers[-1]} of its run are not all here, each once: {'; '.join(wrong)}"


def _in_order(ticks: NDArray[np.void]) -> NDArray[np.void]:
    """Ticks that were held back at rest stand after later ones in the file: see rest_thinning.py."""
    if np.all(ticks["tick"][1:] >= ticks["tick"][:-1]):
        return ticks
    whole_rows = ticks.view(np.dtype((np.void, ticks.dtype.itemsize)))  # with the bytes that no field names
    return whole_rows[np.argsort(ticks["tick"], kind="stable")].view(ticks.dtype)


def _is_cut(error: Exception, at_the_end: bool) -> bool:
    """Whether a file just ends where a record should go on: the writer was killed."""
    return isinstance(error, EndOfFile | RecordLengthLimitExceeded) or (isinstance(error, struct.error) and at_the_end)


def _read_contents(path: Path) -> bytes:
    try:
        contents = path.read_bytes()
    except OSError as error:
        raise LogError(why_not_read(path, error)) from None
    if not contents.startswith(MCAP0_MAGIC):
        raise LogError(f"{path}: damaged at byte 0: this is not how an MCAP file begins")
    return contents


class _Findings:
    """What the records read so far have said."""

    def __init__(self, from_s: float) -> None:
        self._from_s = from_s
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.rows: dict[RowKind, list[bytes]] = {kind: [] for kind in ROW_KINDS}
        self.messages = self.messages_promised = 0
        self._schemas: dict[int, Schema] = {}
        self._rows_of_channel: dict[int, list[bytes]] = {}

    def add(self, record: McapRecord | Row) -> None:
        match record:
            case Row() | Message():
                self._add_row(record)
            case Chunk() if self._is_before(record):
                return
            case Chunk():
                for inner in records_of(open_chunk(record)):
                    self._require_layout(inner, record)
                    self.add(inner)
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

    def _is_before(self, chunk: Chunk) -> bool:
        """All its rows, of a chunk behind the first one, which describes the channels."""
        if self._from_s == -inf or not self._rows_of_channel:
            return False
        end_ns = chunk.message_end_time - int(self.metadata.get("wall_minus_monotonic_ns", "0"))
        return end_ns < 1e9 * self._from_s

    def _require_layout(self, record: Row | Schema | Channel, chunk: Chunk) -> None:
        """Where a checksum vouches for it, another layout is another version's and no damage."""
        if chunk.uncompressed_crc and isinstance(record, Channel):
            require_layout(record, self._schemas.get(record.schema_id))

    def _add_row(self, row: Row | Message) -> None:
        if row.channel_id not in self._rows_of_channel:
            raise ValueError(f"a row of channel {row.channel_id}, which was not described")
        self._rows_of_channel[row.channel_id].append(row.payload if isinstance(row, Row) else row.data)
        self.messages += 1

    def _rows_for(self, channel: Channel) -> list[bytes]:
        """Where this channel's rows belong; those of a channel that is not ours are not kept."""
        for kind in ROW_KINDS:
            if kind.topic == channel.topic:
                try:
                    require_layout(channel, self._schemas.get(channel.schema_id))
                except LayoutError as error:
                    raise ValueError(str(error)) from None
                return self.rows[kind]
        return []


def require_layout(channel: Channel, schema: Schema | None) -> None:
    """Of a topic of ours. Raises LayoutError."""
    for kind in ROW_KINDS:
        if kind.topic == channel.topic and (
            schema is None or _layout(schema.data.decode(errors="replace")) != _layout(kind.ros_text)
        ):
            raise LayoutError(f"rows of {kind.topic} have another layout than this version's")


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
        "run": log.metadata.get("run_id", ""),
        "segment": log.metadata.get("segment", ""),
        "started": _start_time(log),
        "duration_s": duration_s,
        "ticks": len(stamps_s),
        "missed_ticks": int(log.ticks["missed_ticks"][-1]) if len(stamps_s) else 0,
        "rate_hz": (len(stamps_s) - 1) / duration_s if duration_s > 0.0 else 0.0,
        "strides": len(log.strides),
        "events": len(log.events),
        "complete": log.complete,
        "recovered": log.metadata.get("recovered") == "true",
    }


def segment_of(log: Log) -> int:
    """Its number in the run, or its first one's; 0 where none is given."""
    number = log.metadata.get("segment", "")
    return int(number) if number.isdecimal() else 0


def begin_s(log: Log) -> float:
    """When the first row was, by the log's own clock; 0 where there is none."""
    stamps_s = [*log.ticks["stamp_s"][:1], *(row["stamp_s"] for row in (*log.strides[:1], *log.events[:1]))]
    return float(min(stamps_s, default=0.0))


def _start_time(log: Log) -> str:
    """Universal time of the first row, to the second; empty where there is none."""
    if not (len(log.ticks) or log.strides or log.events) or "wall_minus_monotonic_ns" not in log.metadata:
        return ""
    try:
        wall_s = begin_s(log) + int(log.metadata["wall_minus_monotonic_ns"]) / 1e9
        return datetime.fromtimestamp(wall_s, UTC).isoformat(timespec="seconds")
    except (ValueError, OverflowError, OSError):  # no time of this world
        return ""
