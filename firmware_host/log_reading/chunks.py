"""Opens one chunk of an MCAP file without trusting its length fields.

A length that a damaged card has changed must cost neither gigabytes of memory nor a crash. The decompression therefore
ends at the size that the chunk states, that size is limited by what LZ4 can reach, and the contents have to match their
checksum.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import get_chunk_data_stream

LARGEST_RATIO = 256  # of LZ4, whose format allows 255
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


class Row(NamedTuple):
    """One message of the log, still encoded."""

    channel_id: int
    sequence: int
    log_time_ns: int
    data: bytes


def open_chunk(chunk: Chunk) -> bytes:
    """Returns the chunk's records. Raises ValueError or RuntimeError where the chunk is damaged."""
    size = chunk.uncompressed_size
    if size > LARGEST_RATIO * (len(chunk.data) + 1):
        raise ValueError(f"a chunk of {len(chunk.data)} bytes cannot hold {size}")
    if chunk.compression == "lz4":
        contents = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression == "":
        contents = chunk.data
    else:  # another tool has compressed it again
        contents = get_chunk_data_stream(chunk)[0].read(size)
    if len(contents) != size:
        raise ValueError(f"a chunk of {size} bytes holds {len(contents)}")
    if chunk.uncompressed_crc not in (0, zlib.crc32(contents)):
        raise ValueError("crc validation failed in Chunk")
    return bytes(contents)


def split_records(contents: bytes) -> Iterator[Row | Schema | Channel]:
    """Yields the records of an opened chunk. Raises ValueError, struct.error or McapError where they are malformed."""
    end = 0
    while end < len(contents):
        opcode, length = RECORD_HEAD.unpack_from(contents, end)
        start, end = end + RECORD_HEAD.size, end + RECORD_HEAD.size + length
        if end > len(contents):
            raise ValueError("a record reaches beyond its chunk")
        if opcode == Opcode.MESSAGE:
            if length < MESSAGE_HEAD.size:
                raise ValueError("a row is shorter than its head")
            channel_id, sequence, log_time_ns, _ = MESSAGE_HEAD.unpack_from(contents, start)
            yield Row(channel_id, sequence, log_time_ns, contents[start + MESSAGE_HEAD.size : end])
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(contents[start:end])))
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(contents[start:end])))
