"""Reads an MCAP log into arrays, whether or not its writer finished it.

The records are read in order, without the index at the end, so a log whose writer was killed is read up to the byte
where it ends. A damaged log is refused, and the refusal names the byte. Rows are decoded by the schema that the file
carries (schema.py), so logs of older and newer versions are read. The ticks become one numpy array, which for a log of
this version lies over the stored bytes without a copy.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from control.records import TWO_FLIPPERS, Rig
from firmware_host.log.log_file import ATTACHMENT, METADATA
from firmware_host.log.log_folder import why_not_read
from firmware_host.log.rows import EVENT_KIND, ROW_KINDS, STRIDE_KIND, TICK, TICK_KIND, rig_of, row_kinds
from firmware_host.log.schema import LayoutError, RowKind, read_definition
from firmware_host.log_reading.chunks import Row, open_chunk, split_records
from firmware_host.log_reading.log_error import DAMAGE as DAMAGE
from firmware_host.log_reading.log_error import LogError as LogError
from firmware_host.log_reading.log_error import Watch as Watch
from firmware_host.log_reading.log_error import unwatched as unwatched
from firmware_host.log_reading.tick_array import Ticks, sort_ticks, stack_ticks

ADVICE = "'mudskipper log recover' saves its readable rows"
OTHER_VERSION = "read it with the version of mudskipper that wrote it"
KIND_OF_TOPIC = {kind.topic: number for number, kind in enumerate(ROW_KINDS)}


class Log(NamedTuple):
    """One log, or the joined segments of one run."""

    metadata: dict[str, str]
    configuration_text: str
    ticks: Ticks  # the fields of rows.TICK, then those that this version does not know
    strides: list[dict[str, Any]]
    events: list[dict[str, Any]]
    complete: bool  # False where the writer was cut off; everything before that is here
    unknown_fields: tuple[str, ...] = ()  # such as "/tick battery_v", which this version does not know
    missing_fields: tuple[str, ...] = ()  # which the version that wrote the log did not know
    rig: Rig = TWO_FLIPPERS  # whose joints and flippers the arrays of a tick have, in its order


def read_log(path: Path, watch: Watch = unwatched, from_s: float = -inf) -> Log:
    """Reads one file; of the rows before `from_s` it reads only the first chunk. Raises LogError."""
    contents = _read_contents(path)
    found = _Findings(from_s)
    complete = _read_records(path, contents, found, watch)
    if complete and from_s == -inf and found.messages != found.messages_counted:
        raise LogError(
            f"{path}: damaged: only {found.messages} of its {found.messages_counted} rows can be found; {ADVICE}"
        )
    try:
        ticks = stack_ticks(found.kinds.get(TICK_KIND, TICK), found.rows[TICK_KIND])
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    own, present = _field_names(dict(enumerate(ROW_KINDS))), _field_names(found.kinds)
    described = _field_names({number: ROW_KINDS[number] for number in found.kinds})
    return Log(
        found.metadata,
        found.configuration_text,
        ticks,
        _decode_rows(path, found, STRIDE_KIND),
        _decode_rows(path, found, EVENT_KIND),
        complete,
        tuple(name for name in present if name not in own),
        tuple(name for name in described if name not in present),
        rig_of(found.kinds.get(TICK_KIND, TICK).definition),
    )


def _read_contents(path: Path) -> bytes:
    try:
        contents = path.read_bytes()
    except OSError as error:
        raise LogError(why_not_read(path, error)) from None
    if not contents.startswith(MCAP0_MAGIC):
        raise LogError(f"{path}: damaged at byte 0: this is not how an MCAP file begins")
    return contents


def _read_records(path: Path, contents: bytes, found: _Findings, watch: Watch) -> bool:
    """Returns whether the records reach the file's end. Raises LogError for a damaged file."""
    stream = BytesIO(contents)
    reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=len(contents))
    try:
        for record in reader.records:
            found.add(record)
            watch("kB read", stream.tell() // 1000, len(contents) // 1000)
    except LayoutError as error:
        raise LogError(f"{path}: {error}; {OTHER_VERSION}") from None
    except DAMAGE as error:
        finished = len(contents) > len(MCAP0_MAGIC) and contents.endswith(MCAP0_MAGIC)
        if finished or not _is_cut(error, stream.tell() == len(contents)):
            raise LogError(f"{path}: damaged before byte {stream.tell()}: {error}; {ADVICE}") from None
        return False
    return True


def _is_cut(error: Exception, at_the_end: bool) -> bool:
    """Whether the file ends where a record should continue, because the writer was killed."""
    return isinstance(error, EndOfFile | RecordLengthLimitExceeded) or (isinstance(error, struct.error) and at_the_end)


class _Findings:
    """Owns the metadata, the layouts and the encoded rows read so far."""

    def __init__(self, from_s: float) -> None:
        self._from_s = from_s
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.kinds: dict[int, RowKind] = {}  # as the file describes them, by their number in ROW_KINDS
        self.rows: list[list[bytes]] = [[] for _ in ROW_KINDS]
        self.messages = self.messages_counted = 0
        self._schemas: dict[int, Schema] = {}
        self._rows_of_channel: dict[int, list[bytes]] = {}

    def add(self, record: McapRecord | Row, checked: bool = False) -> None:
        """`checked` is whether a checksum has confirmed the record. Raises LayoutError, and DAMAGE."""
        match record:
            case Row() | Message():
                self._add_row(record)
            case Chunk() if self._is_before(record):
                return
            case Chunk():
                for inner in split_records(open_chunk(record)):
                    self.add(inner, bool(record.uncompressed_crc))
            case Schema():
                self._schemas[record.id] = record
            case Channel():
                self._add_channel(record, checked)
            case Attachment(name=name) if name == ATTACHMENT:
                self.configuration_text = record.data.decode()
            case Metadata(name=name) if name == METADATA:
                self.metadata = record.metadata
            case Statistics():
                self.messages_counted = record.message_count

    def _is_before(self, chunk: Chunk) -> bool:
        """Whether all rows of the chunk are before the wanted time; the first chunk describes the channels."""
        if self._from_s == -inf or not self._rows_of_channel:
            return False
        end_ns = chunk.message_end_time - int(self.metadata.get("wall_minus_monotonic_ns", "0"))
        return end_ns < 1e9 * self._from_s

    def _add_row(self, row: Row | Message) -> None:
        if row.channel_id not in self._rows_of_channel:
            raise ValueError(f"a row of channel {row.channel_id}, which was not described")
        self._rows_of_channel[row.channel_id].append(row.data)
        self.messages += 1

    def _add_channel(self, channel: Channel, checked: bool) -> None:
        """A layout that no checksum has confirmed may be damage. Rows of unknown topics are counted and dropped."""
        number = KIND_OF_TOPIC.get(channel.topic)
        self._rows_of_channel[channel.id] = [] if number is None else self.rows[number]
        if number is None:
            return
        try:
            kind = described_kind(number, self._schemas.get(channel.schema_id))
        except LayoutError as error:
            raise error if checked else ValueError(str(error)) from None
        if self.kinds.setdefault(number, kind).definition != kind.definition:
            raise ValueError(f"{channel.topic} is described twice, differently")


def described_kind(number: int, schema: Schema | None) -> RowKind:
    """Returns the row kind of one of our topics as a file describes it. Raises LayoutError."""
    if schema is None:
        raise LayoutError(f"{ROW_KINDS[number].topic} is not described")
    definition = schema.data.decode(errors="replace")
    return read_definition(row_kinds(rig_of(definition))[number], definition)


def _field_names(kinds: Mapping[int, RowKind]) -> list[str]:
    return [f"{kind.topic} {field.name}" for kind in kinds.values() for field in kind.fields]


def _decode_rows(path: Path, found: _Findings, number: int) -> list[dict[str, Any]]:
    own = ROW_KINDS[number]
    kind = found.kinds.get(number, own)
    missing = {field.name: field.missing for field in own.fields}
    decoded = []
    for count, row in enumerate(found.rows[number], 1):
        try:
            decoded.append(missing | kind.decode(row))
        except struct.error as error:
            raise LogError(f"{path}: row {count} of {kind.topic} is damaged: {error}") from None
    return decoded


def read_logs(paths: Sequence[Path], watch: Watch = unwatched, from_s: float = -inf) -> Log:
    """Reads one log, or joins several segments of one run. Raises LogError, also where a segment between is missing."""
    return join_logs(paths, [read_log(path, watch, from_s) for path in paths])


def join_logs(paths: Sequence[Path], logs: Sequence[Log]) -> Log:
    """Joins the logs of several segments of one run; a single log stays as it is. Raises LogError."""
    if len(logs) == 1:
        return logs[0]
    if len({log.metadata.get("run_id") for log in logs}) > 1 or "run_id" not in logs[0].metadata:
        raise LogError(f"{paths[0]}: not of one run with the others; read each alone")
    try:
        by_number = {int(log.metadata["segment"]): log for log in logs}
    except (KeyError, ValueError):
        raise LogError(f"{paths[0]}: the segments of its run are not numbered; read each alone") from None
    numbers = sorted(int(log.metadata["segment"]) for log in logs)
    if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        raise LogError(f"{paths[0]}: {_why_not_joined(numbers)}")
    ordered = [by_number[number] for number in numbers]
    if any(log.ticks.dtype != ordered[0].ticks.dtype for log in ordered):
        raise LogError(f"{paths[0]}: the segments of its run have different fields; read each alone")
    ticks = np.frombuffer(b"".join(log.ticks.tobytes() for log in ordered), dtype=ordered[0].ticks.dtype)
    return ordered[0]._replace(
        ticks=sort_ticks(ticks),
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


def log_summary(log: Log) -> dict[str, Any]:
    """Returns what `mudskipper log info` prints. At rest the log has fewer rows than ticks ran."""
    stamps_s = log.ticks["stamp_s"]
    duration_s = float(stamps_s[-1] - stamps_s[0]) if len(stamps_s) else 0.0
    ticks = _ticks_run(log.ticks)
    return {
        "robot": log.metadata.get("robot", ""),
        "run": log.metadata.get("run_id", ""),
        "segment": segment_of(log) if log.metadata.get("segment") else None,
        "started": _start_time(log),
        "duration_s": round(duration_s, 3),
        "rate_hz": round((ticks - 1) / duration_s, 2) if duration_s > 0.0 else None,
        "rows": len(stamps_s),
        "ticks": ticks,
        "missed_ticks": int(log.ticks["missed_ticks"][-1]) if len(stamps_s) else 0,
        "strides": len(log.strides),
        "events": len(log.events),
        "complete": log.complete,
        "recovered": log.metadata.get("recovered") == "true",
        "version": log.metadata.get("version", ""),
        "commit": log.metadata.get("commit", ""),
        "unknown_fields": list(log.unknown_fields),
        "missing_fields": list(log.missing_fields),
    }


def _ticks_run(ticks: Ticks) -> int:
    """Returns the number of ticks from the first row to the last one, without those that were missed."""
    if not len(ticks):
        return 0
    first, last = ticks[0], ticks[-1]
    return int(last["tick"]) - int(first["tick"]) + 1 - (int(last["missed_ticks"]) - int(first["missed_ticks"]))


def segment_of(log: Log) -> int:
    """Returns the number of the first segment in the run; 0 where none is given."""
    number = log.metadata.get("segment", "")
    return int(number) if number.isdecimal() else 0


def begin_s(log: Log) -> float:
    """Returns the time of the first row by the log's own clock; 0 where there is none."""
    stamps_s = [*log.ticks["stamp_s"][:1], *(row["stamp_s"] for row in (*log.strides[:1], *log.events[:1]))]
    return float(min(stamps_s, default=0.0))


def _start_time(log: Log) -> str:
    """Returns the universal time of the first row, to the second; empty where it is not known."""
    if not (len(log.ticks) or log.strides or log.events) or "wall_minus_monotonic_ns" not in log.metadata:
        return ""
    try:
        wall_s = begin_s(log) + int(log.metadata["wall_minus_monotonic_ns"]) / 1e9
        return datetime.fromtimestamp(wall_s, UTC).isoformat(timespec="seconds")
    except (ValueError, OverflowError, OSError):  # beyond what a date can be
        return ""
