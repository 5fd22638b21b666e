"""Rewrites a log whose writer was cut off: every row that can still be read, with index and statistics.

An unfinished MCAP file lacks the summary at its end, without which most readers refuse it. Its records are read one
after the other. A chunk whose checksum does not fit is skipped by its length, and its rows are lost; where a length
itself is damaged, the reading ends. The rows keep the layout that the file describes; where the description is lost,
they are taken to have that of this version. An event in the rewritten log says how many rows were lost, and so does the
metadata at its beginning, so the file is read twice: once to count, once to write.

The damaged file is renamed to NAME.broken; the new one is written, synchronised and renamed; only then is the damaged
one removed. A recovery that is interrupted at any point is continued by the next one.
"""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from itertools import islice
from math import isfinite
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from firmware_host.log.log_file import ANNOTATION, ATTACHMENT, METADATA, LogFile, lock_file
from firmware_host.log.log_folder import BROKEN, PART, finished_path, move_file, unfinished_files
from firmware_host.log.rows import EVENT_KIND, ROW_KINDS
from firmware_host.log.schema import LayoutError
from logs.files.chunks import RECORD_HEAD, Record, Row, open_chunk, split_records
from logs.files.expansion import Expansion
from logs.files.file_pass import KIND_OF_TOPIC, OTHER_VERSION, described_kind
from logs.files.log_error import DAMAGE, LogError, Watch, unwatched
from logs.files.scanned_log import scan_log

WATCHED_ROWS = 1000  # between two reports of progress


class Recovered(NamedTuple):
    """The result for one file."""

    path: Path  # where the log is now
    rows: int  # in it
    lost: int  # rows in damaged chunks, by their sequence numbers, and of other programs
    note: str  # a message for people


class Salvage:
    """One pass over a damaged file. Owns its layouts, and counts the rows that it yields and those that are lost."""

    def __init__(self, file: BinaryIO) -> None:
        self.metadata: dict[str, str] = {}
        self.configuration_text = ""
        self.kinds = list(ROW_KINDS)  # as the file describes them
        self.rows = self.foreign = 0  # yielded; of unknown topics
        self.ended = False  # whether the pass has reached the end of the rows, which only a finished file has
        self.wall_offset_ns = 0
        self.last_stamp_s = 0.0  # of the last row with a time
        self._file, self._size = file, os.fstat(file.fileno()).st_size
        self._expansion = Expansion(Path(file.name), self._size)
        self._number_of_channel = {number + 1: number for number in range(len(ROW_KINDS))}  # as LogFile numbers them
        self._schemas: dict[int, Schema] = {}
        self._expected = [0] * len(ROW_KINDS)  # sequence number after the largest one found
        self._found = [0] * len(ROW_KINDS)
        self._chunks = set[tuple[int, int, int]]()

    @property
    def lost(self) -> int:
        """Rows whose numbers are missing before the last one found."""
        return sum(max(0, expected - found) for expected, found in zip(self._expected, self._found, strict=True))

    @property
    def note(self) -> str:
        parts = [f"recovered: {self.rows} rows"]
        parts += [f", {self.lost} lost in damaged places"] * bool(self.lost)
        parts += [f", {self.foreign} of other programs left out"] * bool(self.foreign)
        parts += ["; the rows after the last of them are missing"] * (not self.ended)
        return "".join(parts)

    def found_rows(self, watch: Watch = unwatched) -> Iterator[tuple[int, bytes]]:
        """Make the pass: yield the number of its kind and the bytes of every row. Raises LayoutError, OSError."""
        for opcode, contents in self._records(watch):
            records: list[Record] = []
            with suppress(*DAMAGE):
                records = self._read(opcode, ReadDataStream(BytesIO(contents)))
            yield from self._add_records(records)

    def _read(self, opcode: int, stream: ReadDataStream) -> list[Record]:
        """Return the records of a chunk, each chunk once: a piece of a file may be in it twice. Raises DAMAGE."""
        if opcode == Opcode.METADATA and (metadata := Metadata.read(stream)).name in (METADATA, ANNOTATION):
            self.metadata |= metadata.metadata
            self.wall_offset_ns = int(self.metadata.pop("wall_minus_monotonic_ns", self.wall_offset_ns))
        elif opcode == Opcode.ATTACHMENT and (attachment := Attachment.read(stream)).name == ATTACHMENT:
            self.configuration_text = attachment.data.decode()
        elif opcode == Opcode.CHUNK:
            chunk = Chunk.read(stream)
            key = chunk.uncompressed_crc, chunk.uncompressed_size, chunk.message_start_time
            if key not in self._chunks:
                contents = open_chunk(chunk)
                self._expansion.add(len(contents))
                records = list(split_records(contents))
                self._chunks.add(key)
                return records
        return []

    def _records(self, watch: Watch) -> Iterator[tuple[int, bytes]]:
        """Yield opcode and contents of each record before the summary, up to the first with a damaged length."""
        descriptor, position = self._file.fileno(), len(MCAP0_MAGIC)
        while len(head := os.pread(descriptor, RECORD_HEAD.size, position)) == RECORD_HEAD.size:
            watch("kB searched", position // 1000, self._size // 1000)
            opcode, length = RECORD_HEAD.unpack(head)
            position += RECORD_HEAD.size
            self.ended = opcode == Opcode.DATA_END
            if not opcode or self.ended or length > self._size - position:
                return
            yield opcode, os.pread(descriptor, length, position)
            position += length

    def _add_records(self, records: list[Record]) -> Iterator[tuple[int, bytes]]:
        for record in records:
            match record:
                case Schema():
                    self._schemas[record.id] = record
                case Channel():
                    self._number_of_channel.pop(record.id, None)
                    if (number := KIND_OF_TOPIC.get(record.topic)) is not None:
                        self.kinds[number] = described_kind(
                            number, self._schemas.get(record.schema_id), record.metadata
                        )
                        self._number_of_channel[record.id] = number
                case Row():
                    yield from self._add_row(record)

    def _add_row(self, row: Row) -> Iterator[tuple[int, bytes]]:
        number = self._number_of_channel.get(row.channel_id)
        if number is None:
            self.foreign += 1
        elif self.kinds[number].fits(row.data):
            stamp_s = self.kinds[number].stamp_s(row.data)
            if isfinite(stamp_s):
                self.wall_offset_ns = self.wall_offset_ns or row.log_time_ns - round(stamp_s * 1e9)
                self.last_stamp_s = stamp_s
            self._expected[number] = max(self._expected[number], row.sequence + 1)
            self._found[number] += 1
            self.rows += 1
            yield number, row.data


def salvage_rows(path: Path, file: BinaryIO, watch: Watch = unwatched) -> Salvage:
    """Find every row of a file, and count them; `found_rows` of a new Salvage yields them again.

    Raises OSError, and LogError for a file that never was one of our logs, or that this version cannot decode.
    """
    salvage = Salvage(file)
    try:
        for _ in salvage.found_rows(watch):
            pass
    except LayoutError as error:
        raise LogError(f"{path}: left as it is: {error}; {OTHER_VERSION}") from None
    if not salvage.rows and not salvage.metadata:
        raise LogError(f"{path}: left as it is: nothing of a log can be found in it")
    return salvage


def recover_all(folder: Path, complain: Callable[[str], None]) -> list[Recovered]:
    """Recover every unfinished log of a log folder, except those of living writers; complain of each failure."""
    recovered = []
    for path in unfinished_files(folder):
        try:
            recovered.append(recover_log(path))
        except (BlockingIOError, FileNotFoundError):
            continue  # being written, or finished meanwhile
        except LogError as problem:
            complain(str(problem))
        except OSError as problem:
            complain(f"{path}: cannot be recovered: {problem.strerror or problem}")
    return recovered


def recover_log(path: Path, watch: Watch = unwatched) -> Recovered:
    """Recover one file. Raises LogError, and OSError; BlockingIOError where the log's writer lives."""
    with path.open("rb") as file:
        lock_file(file.fileno(), path)
        if path.name.endswith(PART) or not path.stat().st_size:
            path.unlink()
            return Recovered(path, 0, 0, "an interrupted recovery, removed" if PART in path.name else "empty, removed")
        target = finished_path(path.with_name(path.name.removesuffix(BROKEN)))
        present_rows = _rows_of_whole(target) if target != path else None
        if (own_rows := _rows_of_whole(path, watch)) is not None and present_rows is None:
            if target != path:  # its writer ended between its last byte and the renaming
                move_file(path, target)
            return Recovered(target, 0, 0, "is whole")
        salvage = salvage_rows(path, file, watch)
        if present_rows is not None:
            if present_rows < max(salvage.rows, own_rows or 0):
                raise LogError(f"{path}: left as it is: {target} has its name and fewer rows; rename one of them")
            path.unlink()
            return Recovered(target, 0, 0, "was recovered before")
        return _rewrite(path, target, file, salvage, watch)


def _rows_of_whole(path: Path, watch: Watch = unwatched) -> int | None:
    """Return the number of rows of a finished log that can be read; None for any other file."""
    with suppress(LogError):
        log = scan_log(path, watch)
        return log.rows + len(log.strides) + len(log.events) if log.complete else None
    return None


def _rewrite(path: Path, target: Path, file: BinaryIO, salvage: Salvage, watch: Watch) -> Recovered:
    """Raises OSError, and LogError for a file that was changed meanwhile, which stays as NAME.broken."""
    broken = path if path.name.endswith(BROKEN) else path.with_name(path.name + BROKEN)
    path.rename(broken)
    part = broken.with_name(target.name + PART)
    part.unlink(missing_ok=True)
    lost = salvage.lost + salvage.foreign
    opening = {
        "configuration_text": salvage.configuration_text,
        "metadata": salvage.metadata | {"recovered": "true", "rows_lost": str(lost)},
        "wall_minus_monotonic_ns": salvage.wall_offset_ns,
    }
    event = salvage.kinds[EVENT_KIND].encode_named(stamp_s=salvage.last_stamp_s, text=salvage.note)
    log = LogFile(part, opening, salvage.kinds)
    try:
        again = Salvage(file)
        rows = again.found_rows()
        while piece := list(islice(rows, WATCHED_ROWS)):
            log.write(piece)
            watch("rows written", again.rows, salvage.rows)
        if again.rows != salvage.rows:
            raise LogError(f"{broken}: was changed while it was read: nothing was recovered and it stays as it is")
        log.write([(EVENT_KIND, event)])
        log.finish()
    except (OSError, LogError):
        log.abandon()
        part.unlink(missing_ok=True)
        raise
    move_file(part, target)
    broken.unlink()
    return Recovered(target, salvage.rows, lost, salvage.note)


def main() -> None:
    """Recover the unfinished logs of one folder, at low priority; the log's writer starts this as a process."""
    with suppress(PermissionError):
        os.nice(5)

    def complain(message: str) -> None:
        print(message, file=sys.stderr, flush=True)

    for recovered in recover_all(Path(sys.argv[1]), complain):
        complain(f"{recovered.path}: {recovered.note}")


if __name__ == "__main__":
    main()
