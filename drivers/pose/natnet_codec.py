"""Decodes messages of OptiTrack's NatNet protocol from UDP packets, as far as the pose of one rigid body needs.

Layout (little-endian), as in the NatNet SDK's sample clients PacketClient and PythonClient: u16 message, u16 bytes that
follow. Server information (1): 256 bytes of name, 4 of the program's version, 4 of the protocol's; from 3.0 on
u64 ticks of the clock per second, u16 data port, a flag for multicast, 4 bytes of its address. A frame (7): i32 number,
then sections that each begin with an i32 count, and from 4.1 on with the i32 bytes of what follows:

    marker sets        name, zero byte, i32 markers, 12 bytes each
    other markers      12 bytes each
    rigid bodies       i32 id, f32 x y z, f32 qx qy qz qw; before 3.0: i32 markers, 20 bytes each; f32 mean error,
                       u16 flags; the lowest is set while the body is tracked
    skeletons          i32 id, i32 bones, each as a rigid body
    assets             only from 4.1 on
    labelled markers   22 bytes each; from 3.0 on 26
    force plates       from 2.9 on: i32 id, i32 channels, each i32 values, 4 bytes each
    devices            from 2.11 on, as force plates

and ends with u32 time code, u32 part of it, f64 seconds of the software (before 2.7 f32); from 3.0 on the ticks at
which the cameras' shutters were half through, the images had arrived and the frame was sent, u64 each; from 4.1 on two
u32 of a precision time; u16 flags, i32 zero. Versions before 2.6 are not supported, because they do not report whether
a body is tracked. The description of models (5): i32 descriptions, each i32 kind, from 4.1 on i32 bytes that follow:

    marker set (0)     its name and a zero byte, i32 markers, each a name and a zero byte
    rigid body (1)     its name and a zero byte, i32 id, i32 parent, f32 x y z; from 3.0 on i32 markers, 12 bytes of a
                       position and 4 of a label each, from 4.0 on a name and a zero byte each

Other kinds are skipped by their size. Before 4.1 they do not contain it, so there the reader stops at the first of
them; Motive sends marker sets and rigid bodies first.

No library is used: natnet_bridge.py says why.
"""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from struct import Struct
from typing import NamedTuple

CONNECT, SERVER_INFO, REQUEST_MODEL, MODEL, FRAME, KEEP_ALIVE = 0, 1, 4, 5, 7, 10
HEADER = Struct("<HH")
LONGEST_PACKET = 65535
NAME_BYTES = 256
SERVER_VERSIONS = Struct("<4B4B")
SERVER_CLOCK = Struct("<QHB4s")
INTEGER = Struct("<i")
TWO_INTEGERS = Struct("<ii")
POSE = Struct("<i7f")  # of a rigid body
QUALITY = Struct("<fH")
TRACKED = 0x01
MODELS_CHANGED = 0x02
VECTOR_BYTES = 12
MARKER_BYTES = 20  # of a rigid body before 3.0: its position, id and size
CHANNEL_VALUE_BYTES = 4
MARKER_SET, RIGID_BODY = 0, 1  # kinds of description


class NatNetVersion(NamedTuple):
    major: int
    minor: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}"


OLDEST, NEWEST = NatNetVersion(2, 6), NatNetVersion(4, 255)


class ServerInfo(NamedTuple):
    name: str
    version: NatNetVersion  # of the protocol
    ticks_per_s: int  # of the clock of a frame's ticks; 0 where the version has none


class RigidBody(NamedTuple):
    identity: int  # its streaming id
    position_m: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]  # x, y, z, w
    tracked: bool


class MotionFrame(NamedTuple):
    body: RigidBody | None  # the requested one, where the frame contains it
    software_s: float
    exposed_ticks: int  # 0 where the version has none
    sent_ticks: int
    models_changed: bool


class MalformedPacketError(ValueError):
    """The packet is no NatNet message, or is truncated."""


@contextmanager
def _decoding() -> Iterator[None]:
    """Raise MalformedPacketError for any error in decoding, also as a decorator."""
    try:
        yield
    except (struct.error, ValueError, OverflowError) as problem:
        raise MalformedPacketError(str(problem)) from None


def encode_request(message: int) -> bytes:
    """Encode CONNECT, REQUEST_MODEL or KEEP_ALIVE. A server answers CONNECT by its information."""
    payload = b"Ping\0" if message == CONNECT else b""
    return HEADER.pack(message, len(payload)) + payload


def message_of(packet: bytes) -> int:
    """Return the kind of message. Raises MalformedPacketError for a packet that ends before its payload."""
    if len(packet) < HEADER.size:
        raise MalformedPacketError("no header")
    message, size = HEADER.unpack_from(packet)
    if len(packet) < HEADER.size + size:
        raise MalformedPacketError("truncated")
    return int(message)


@_decoding()
def decode_server_info(packet: bytes) -> ServerInfo:
    """Decode a server's information; raises MalformedPacketError."""
    end = HEADER.size + NAME_BYTES
    name = packet[HEADER.size : end].partition(b"\0")[0].decode(errors="replace")
    major, minor = SERVER_VERSIONS.unpack_from(packet, end)[4:6]
    ticks_per_s = SERVER_CLOCK.unpack_from(packet, end + SERVER_VERSIONS.size)[0] if major >= 3 else 0
    return ServerInfo(name, NatNetVersion(major, minor), ticks_per_s)


def _read_count(packet: bytes, offset: int) -> tuple[int, int]:
    """Return a count, and the offset of the bytes after it."""
    (count,) = INTEGER.unpack_from(packet, offset)
    if count < 0:
        raise MalformedPacketError("a negative count")
    return count, offset + INTEGER.size


Parts = tuple["int | str | Parts", ...]  # of an item: so many bytes, NAME, or a count of items with these parts
NAME = "name"  # a text that ends with a zero byte
MARKER_SETS: Parts = (NAME, (VECTOR_BYTES,))
OTHER_MARKERS: Parts = (VECTOR_BYTES,)
CHANNELS: Parts = (INTEGER.size, ((CHANNEL_VALUE_BYTES,),))  # of force plates or of devices


def _skip_items(packet: bytes, offset: int, parts: Parts) -> int:
    """Return the end of a count of items with these parts."""
    count, offset = _read_count(packet, offset)
    if parts and all(isinstance(part, int) for part in parts):
        return offset + count * sum(part for part in parts if isinstance(part, int))
    for _ in range(count):
        for part in parts:
            if isinstance(part, int):
                offset += part
            elif isinstance(part, str):
                offset = packet.index(0, offset) + 1
            else:
                offset = _skip_items(packet, offset, part)
    return offset


class FrameLayout:
    """The layout of one version's frames."""

    def __init__(self, version: NatNetVersion) -> None:
        self.has_sizes, self.has_ticks = version >= (4, 1), version >= (3, 0)
        self._markers_of_body: list[Parts] = [] if self.has_ticks else [(MARKER_BYTES,)]
        body: Parts = (POSE.size, *self._markers_of_body, QUALITY.size)
        self._after_bodies: list[Parts] = [(INTEGER.size, body), (26 if self.has_ticks else 22,)]
        self._after_bodies += [CHANNELS] * ((version >= (2, 9)) + (version >= (2, 11)))
        if self.has_sizes:
            self._after_bodies.append(())  # the assets
        software = "d" if version >= (2, 7) else "f"
        ticks = "QQQ" if self.has_ticks else ""
        precision = "II" if self.has_sizes else ""
        self.end = Struct(f"<II{software}{ticks}{precision}H")

    @_decoding()
    def decode_frame(self, packet: bytes, identity: int) -> MotionFrame:
        """Decode a frame with the rigid body of that streaming id; 0: the first. Raises MalformedPacketError."""
        offset = self._skip_section(packet, HEADER.size + INTEGER.size, MARKER_SETS)
        offset = self._skip_section(packet, offset, OTHER_MARKERS)
        body, offset = self._find_body(packet, offset, identity)
        for parts in self._after_bodies:
            offset = self._skip_section(packet, offset, parts)
        end = self.end.unpack_from(packet, offset)
        if not isfinite(end[2]):
            raise MalformedPacketError("a time that is not finite")
        exposed, sent = (end[3], end[5]) if self.has_ticks else (0, 0)
        return MotionFrame(
            body=body,
            software_s=end[2],
            exposed_ticks=exposed,
            sent_ticks=sent,
            models_changed=bool(end[-1] & MODELS_CHANGED),
        )

    def _skip_section(self, packet: bytes, offset: int, parts: Parts) -> int:
        if not self.has_sizes:
            return _skip_items(packet, offset, parts)
        _, offset = _read_count(packet, offset)
        size, offset = _read_count(packet, offset)
        return offset + size

    def _find_body(self, packet: bytes, offset: int, identity: int) -> tuple[RigidBody | None, int]:
        """Return the requested body, and the end of the section."""
        count, offset = _read_count(packet, offset)
        offset += INTEGER.size * self.has_sizes
        found = None
        for _ in range(count):
            numbers = POSE.unpack_from(packet, offset)  # every item, so that a wrong count ends with the packet
            offset += POSE.size
            for parts in self._markers_of_body:
                offset = _skip_items(packet, offset, parts)
            _, flags = QUALITY.unpack_from(packet, offset)
            offset += QUALITY.size
            if found is None and identity in (0, numbers[0]):
                tracked = bool(flags & TRACKED) and isfinite(sum(numbers[1:4]))
                found = RigidBody(numbers[0], numbers[1:4], numbers[4:], tracked)
        return found, offset


@_decoding()
def decode_bodies(packet: bytes, version: NatNetVersion) -> dict[str, int]:
    """Return the streaming ids of rigid bodies by name. Raises MalformedPacketError."""
    has_sizes, bodies = version >= (4, 1), dict[str, int]()
    count, offset = _read_count(packet, HEADER.size)
    for _ in range(count):
        (kind,) = INTEGER.unpack_from(packet, offset)
        offset += INTEGER.size
        size, offset = _read_count(packet, offset) if has_sizes else (0, offset)
        if kind == RIGID_BODY:
            end = packet.index(0, offset)
            bodies[packet[offset:end].decode(errors="replace")] = INTEGER.unpack_from(packet, end + 1)[0]
        elif not has_sizes and kind != MARKER_SET:
            break
        offset = offset + size if has_sizes else _end_of(packet, offset, kind, version)
    return bodies


def _end_of(packet: bytes, offset: int, kind: int, version: NatNetVersion) -> int:
    """Return the end of a description that does not contain its size."""
    offset = packet.index(0, offset) + 1
    if kind == MARKER_SET:
        return _skip_items(packet, offset, (NAME,))
    offset += TWO_INTEGERS.size + VECTOR_BYTES
    if version < (3, 0):
        return offset
    markers, offset = _read_count(packet, offset)
    offset += (VECTOR_BYTES + INTEGER.size) * markers
    for _ in range(markers if version >= (4, 0) else 0):
        offset = packet.index(0, offset) + 1
    return offset
