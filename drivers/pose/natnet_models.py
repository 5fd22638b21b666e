"""Decodes NatNet's model description: the streaming ids of rigid bodies by their names.

Layout of message 5 (see natnet_codec.py): i32 descriptions, each i32 kind, from 4.1 on i32 bytes of what follows, then

    marker set (0)   its name and a zero byte, i32 markers, each a name and a zero byte
    rigid body (1)   its name and a zero byte, i32 id, i32 parent, f32 x y z; from 3.0 on
                     i32 markers, 12 bytes of a position and 4 of a label each, from 4.0 on a name and a zero byte each

Other kinds are skipped by their size. Before 4.1 they do not contain it, so there the reader stops at the first of
them; Motive sends marker sets and rigid bodies first.
"""

from __future__ import annotations

from collections.abc import Iterator

from drivers.pose.natnet_codec import (
    DECODING_ERRORS,
    HEADER,
    INTEGER,
    TWO_INTEGERS,
    VECTOR_BYTES,
    MalformedPacketError,
    NatNetVersion,
)

MARKER_SET, RIGID_BODY = 0, 1


def decode_bodies(packet: bytes, version: NatNetVersion) -> dict[str, int]:
    """Returns streaming ids by name. Raises MalformedPacketError."""
    try:
        return dict(_bodies(packet, version))
    except DECODING_ERRORS as problem:
        raise MalformedPacketError(str(problem)) from None


def _bodies(packet: bytes, version: NatNetVersion) -> Iterator[tuple[str, int]]:
    has_sizes = version >= (4, 1)
    count, offset = _count(packet, HEADER.size)
    for _ in range(count):
        (kind,) = INTEGER.unpack_from(packet, offset)
        offset += INTEGER.size
        size, offset = _count(packet, offset) if has_sizes else (0, offset)
        if kind == RIGID_BODY:
            yield _name(packet, offset)
        elif not has_sizes and kind != MARKER_SET:
            return
        offset = offset + size if has_sizes else _end_of(packet, offset, kind, version)


def _count(packet: bytes, offset: int) -> tuple[int, int]:
    (count,) = INTEGER.unpack_from(packet, offset)
    if count < 0:
        raise MalformedPacketError("a negative count")
    return count, offset + INTEGER.size


def _name(packet: bytes, offset: int) -> tuple[str, int]:
    end = packet.index(0, offset)
    (identity,) = INTEGER.unpack_from(packet, end + 1)
    return packet[offset:end].decode(errors="replace"), identity


def _end_of(packet: bytes, offset: int, kind: int, version: NatNetVersion) -> int:
    """Returns the end of a description that does not contain its size."""
    offset = packet.index(0, offset) + 1
    if kind == RIGID_BODY:
        offset += TWO_INTEGERS.size + VECTOR_BYTES
        if version < (3, 0):
            return offset
    markers, offset = _count(packet, offset)
    if kind == RIGID_BODY:
        offset += (VECTOR_BYTES + INTEGER.size) * markers
    for _ in range(markers if kind == MARKER_SET or version >= (4, 0) else 0):
        offset = packet.index(0, offset) + 1
    return offset
