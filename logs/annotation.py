"""Changes the description of a log that is closed, by a record of the file itself.

A record in the file survives what a second file next to it does not: to be renamed, sent or copied alone. The rows stay
where they are. The record takes the place of the file's index, which is written again after it. Should the power fail
meanwhile, the log looks cut off, and `log recover` finds all of its rows. Earlier descriptions stay in the file.
"""

import os
import struct
import zlib
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import DataEnd, Footer, Metadata, MetadataIndex
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from firmware_host.log.log_file import ANNOTATION, METADATA, lock_file
from firmware_host.trial import METADATA_KEY, Trial, changed, from_json, to_json
from logs.files.log_error import ADVICE, DAMAGE, LogError

DATA_END = struct.Struct("<BQI")  # opcode, length, checksum
FOOTER = struct.Struct("<BQQQI")  # opcode, length, positions of summary and of its offsets, checksum


def annotate(path: Path, changes: Mapping[str, str]) -> Trial:
    """Return the new description. Raises LogError, OSError, and ValueError for keys or values that are not accepted."""
    with path.open("r+b") as file:
        try:
            lock_file(file.fileno(), path)
        except BlockingIOError:
            raise LogError(f"{path}: is being written: 'mudskipper note' writes into it") from None
        if os.pread(file.fileno(), len(MCAP0_MAGIC), 0) != MCAP0_MAGIC:
            raise LogError(f"{path}: is no log: an MCAP file begins otherwise")
        try:
            reader = make_reader(file)
            summary, records = reader.get_summary(), list(reader.iter_metadata())
        except (*DAMAGE, OSError):
            summary, records = None, []
        if summary is None or summary.statistics is None:
            raise LogError(f"{path}: its end is missing; {ADVICE}")
        if not any(record.name == METADATA for record in records):
            raise LogError(f"{path}: mudskipper did not write this file")
        known = [record.metadata[METADATA_KEY] for record in records if METADATA_KEY in record.metadata]
        trial = changed(from_json(known[-1]) if known else {}, changes)
        _append(path, file, summary, _annotation(trial))
    return trial


def _annotation(trial: Trial) -> Metadata:
    described = {METADATA_KEY: to_json(trial), "annotated": datetime.now(UTC).isoformat(timespec="seconds")}
    return Metadata(ANNOTATION, described | {"annotated_by": f"uid {os.getuid()}"})


def _append(path: Path, file: BinaryIO, summary: Summary, record: Metadata) -> None:
    """Write the record over the end of the data, and the end and the index after it."""
    file.seek(-FOOTER.size - len(MCAP0_MAGIC), os.SEEK_END)
    end = FOOTER.unpack(file.read(FOOTER.size))[2] - DATA_END.size
    file.seek(end)
    if DATA_END.unpack(file.read(DATA_END.size))[0] != Opcode.DATA_END:
        raise LogError(f"{path}: another program has changed its end")
    tail = RecordBuilder()
    record.write(tail)
    summary.metadata_indexes.append(MetadataIndex(end, tail.count, record.name))
    DataEnd(0).write(tail)
    start = end + tail.count
    index = _index_of(summary)
    tail.write(index)
    footer = FOOTER.pack(Opcode.FOOTER, FOOTER.size - 9, start, 0, 0)[:-4]
    Footer(start, 0, zlib.crc32(footer, zlib.crc32(index))).write(tail)
    tail.write(MCAP0_MAGIC)
    _replace_end(file.fileno(), end, tail.end())  # type: ignore[no-untyped-call]


def _replace_end(descriptor: int, start: int, end: bytes) -> None:
    """Write all of a longer end, or leave the present one: the disk may be full. Raises OSError."""
    present, unwritten = os.pread(descriptor, len(end), start), memoryview(end)
    try:
        while unwritten:
            unwritten = unwritten[os.pwrite(descriptor, unwritten, start + len(end) - len(unwritten)) :]
        os.fsync(descriptor)
    except OSError:
        os.pwrite(descriptor, present, start)
        os.ftruncate(descriptor, start + len(present))
        raise


def _index_of(summary: Summary) -> bytes:
    assert summary.statistics is not None
    statistics = replace(summary.statistics, metadata_count=len(summary.metadata_indexes))
    index = RecordBuilder()
    for record in (
        *summary.schemas.values(),
        *summary.channels.values(),
        statistics,
        *summary.chunk_indexes,
        *summary.attachment_indexes,
        *summary.metadata_indexes,
    ):
        record.write(index)
    return bytes(index.end())  # type: ignore[no-untyped-call]
