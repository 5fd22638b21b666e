"""A chunk of an MCAP file, opened without trust: what it says of itself is checked before memory is spent on it.

A length field that a damaged card has changed must cost neither gigabytes nor a crash, so nothing is decompressed
beyond the size that the chunk names, that size is bounded by what the compression can reach, and the content has to
match its checksum.
"""

from __future__ import annotations

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
    channel_id: int
    sequence: int
    log_time_ns: int
    payload: bytes


def open_chunk(chunk: Chunk) -> bytes:
    """Its records. Raises ValueError or RuntimeError where it is damaged."""
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


def records_of(contents: bytes) -> Iterator[Row | Schema | Channel]:
    """What an opened chunk holds. Raises ValueError, struct.error or an error of mcap where that makes no sense."""
    place = 0
    while place < len(contents):
        opcode, length = RECORD_HEAD.unpack_from(contents, place)
        start, place = place + RECORD_HEAD.size, place + RECORD_HEAD.size + length
        if place > len(contents):
            raise ValueError("a record reaches beyond its chunk")
        if opcode == Opcode.MESSAGE:
            if length < MESSAGE_HEAD.size:
                raise ValueError("a row is shorter than its head")
            channel_id, sequence, log_time_ns, _ = MESSAGE_HEAD.unpack_from(contents, start)
            yield Row(channel_id, sequence, log_time_ns, contents[start + MESSAGE_HEAD.size : place])
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(contents[start:place])))
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(contents[start:place])))
