"""Opens one chunk of an MCAP file without trusting its length fields, and splits it into records.

A length that a damaged card has changed must cost neither gigabytes of memory nor a crash. The decompression therefore
ends at the size that the chunk states, that size is limited (expansion.py), also by what LZ4 can reach, and the
contents have to match their checksum. Messages of one channel and one length that follow one another, as most ticks do,
are one array over the chunk's bytes.
"""

import struct
import zlib
from collections.abc import Iterator
from functools import cache
from io import BytesIO
from typing import TypeAlias

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
MOST_AT_ONCE = 1024  # messages, so that a chunk of many short runs costs no more than one of long ones

Messages: TypeAlias = NDArray[np.void]  # at least one, all of one channel and one length, with the fields of LAYOUT
Record: TypeAlias = Messages | Schema | Channel


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
    start = 0
    while start < len(contents):
        opcode, length = RECORD_HEAD.unpack_from(contents, start)
        inside, end = start + RECORD_HEAD.size, start + RECORD_HEAD.size + length
        if end > len(contents):
            raise ValueError("a record reaches beyond its chunk")
        if opcode == Opcode.MESSAGE:
            messages = _messages_at(contents, start, length)
            yield messages
            end = start + messages.nbytes
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield (Schema if opcode == Opcode.SCHEMA else Channel).read(ReadDataStream(BytesIO(contents[inside:end])))
        start = end


def _messages_at(contents: bytes, start: int, length: int) -> Messages:
    """Return the messages that follow one another from `start` on."""
    if length < MESSAGE_HEAD.size:
        raise ValueError("a row is shorter than its head")
    layout = _message_layout(length - MESSAGE_HEAD.size)
    messages = np.frombuffer(contents, layout, min((len(contents) - start) // layout.itemsize, MOST_AT_ONCE), start)
    is_other = np.logical_or.reduce([messages[name] != messages[name][0] for name in ("opcode", "length", "channel")])
    return messages[: np.argmax(is_other)] if is_other.any() else messages


@cache
def _message_layout(size: int) -> np.dtype[np.void]:
    """The record of a message whose row has so many bytes."""
    fields = [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log_time_ns", "<u8")]
    return np.dtype([*fields, ("publish_time_ns", "<u8"), ("row", f"V{size}")])
