"""The records in which rows travel between processes: kind (one byte), length (four, little-endian), content."""

import struct

HEADER = struct.Struct("<BI")
Record = tuple[int, bytes]  # kind, content


def pack_record(kind: int, content: bytes) -> bytes:
    return HEADER.pack(kind, len(content)) + content


def split_records(data: bytes) -> tuple[list[Record], bytes]:
    """Return the whole records and the bytes after them."""
    records: list[Record] = []
    start = 0
    while start + HEADER.size <= len(data):
        kind, length = HEADER.unpack_from(data, start)
        end = start + HEADER.size + length
        if end > len(data):
            break
        records.append((kind, data[start + HEADER.size : end]))
        start = end
    return records, data[start:]
