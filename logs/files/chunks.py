"""Opens one chunk of an MCAP file without trusting its length fields, and splits it into records.

A length that a damaged card has changed must cost neither gigabytes of memory nor a crash. The decompression therefore
ends at the size that the chunk states, that size is limited (expansion.py), also by what LZ4 can reach, and the
contents have to match their checksum. Most records of a log are ticks of one length, one after another: such a run is
one array over the chunk's bytes.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard  # a requirement of mcap
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from numpy.typing import NDArray

from logs.files.expansion import LARGEST_CHUNK_BYTES

LARGEST_RATIO = 256  # of LZ4, whose format allows 255
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
ROW_AT = RECORD_HEAD.size + MESSAGE_HEAD.size


class Row(NamedTuple):
    """One message of the log, still encoded."""

    channel_id: int
    sequence: int
    log_time_ns: int
    data: bytes


Record = Row | Schema | Channel


def open_chunk(chunk: Chunk) -> bytes:
    """Return the chunk's records. Raises ValueError or RuntimeError where the chunk is damaged."""
    size, stored = chunk.uncompressed_size, len(chunk.data)
    most = stored if chunk.compression == "" else min(LARGEST_RATIO * (stored + 1), LARGEST_CHUNK_BYTES)
    if size > most:
        raise ValueError(f"a chunk of {stored} bytes cannot hold {size}, at most {most}")
    match chunk.compression:
        case "lz4":
            contents = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        case "zstd":  # another tool has compressed it again
            contents = _open_zstd(chunk.data, size)
        case "":
            contents = chunk.data
        case other:
            raise ValueError(f"a chunk has the compression {other!r:.20}, which must be lz4 or zstd")
    if len(contents) != size:
        raise ValueError(f"a chunk of {size} bytes holds {len(contents)}")
    if chunk.uncompressed_crc not in (0, zlib.crc32(contents)):
        raise ValueError("crc validation failed in Chunk")
    return bytes(contents)


def _open_zstd(stored: bytes, size: int) -> bytes:
    """Return at most one byte more than `size`: the stored bytes may state any length."""
    try:
        return zstandard.ZstdDecompressor().stream_reader(stored).read(size + 1)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None


def split_records(contents: bytes) -> Iterator[Record]:
    """Yield the records of an opened chunk. Raises ValueError, struct.error or McapError where they are malformed."""
    end = 0
    while end < len(contents):
        record, end = record_at(contents, end)
        if record is not None:
            yield record


def record_at(contents: bytes, start: int) -> tuple[Record | None, int]:
    """Return the record that starts there, None for one of another kind, and where it ends. Raises as above."""
    opcode, length = RECORD_HEAD.unpack_from(contents, start)
    start, end = start + RECORD_HEAD.size, start + RECORD_HEAD.size + length
    if end > len(contents):
        raise ValueError("a record reaches beyond its chunk")
    if opcode == Opcode.MESSAGE:
        if length < MESSAGE_HEAD.size:
            raise ValueError("a row is shorter than its head")
        channel_id, sequence, log_time_ns, _ = MESSAGE_HEAD.unpack_from(contents, start)
        return Row(channel_id, sequence, log_time_ns, contents[start + MESSAGE_HEAD.size : end]), end
    if opcode == Opcode.SCHEMA:
        return Schema.read(ReadDataStream(BytesIO(contents[start:end]))), end
    if opcode == Opcode.CHANNEL:
        return Channel.read(ReadDataStream(BytesIO(contents[start:end]))), end
    return None, end


def run_of_rows(contents: bytes, start: int, channel_id: int, size: int) -> NDArray[np.void]:
    """Return the rows of `size` bytes of one channel that follow one another from `start` on; none where another does.

    The next record starts `size + ROW_AT` bytes later for each of them.
    """
    names, formats = ["opcode", "length", "channel", "row"], ["u1", "<u8", "<u2", f"V{size}"]
    layout = np.dtype({"names": names, "formats": formats, "offsets": [0, 1, RECORD_HEAD.size, ROW_AT]})
    count = (len(contents) - start) // layout.itemsize
    records = np.frombuffer(contents, layout, count, start)
    is_other = records["opcode"] != Opcode.MESSAGE
    is_other |= records["length"] != MESSAGE_HEAD.size + size
    is_other |= records["channel"] != channel_id
    rows: NDArray[np.void] = records["row"]
    return rows[: np.argmax(is_other)] if is_other.any() else rows
