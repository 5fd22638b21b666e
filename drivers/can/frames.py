"""One CAN 2.0 frame, and its 16 bytes as Linux lays out `struct can_frame`.

The layout is that of linux/can.h on a little-endian machine: a 32-bit identifier whose top bits mark
extended, remote and error frames, the length, three bytes of padding, eight of data. An error frame's
identifier holds error class bits, not an address: look at `is_error` first. A remote frame asks for data and
carries none; the length that it asks for is not kept, since no drive here looks at it.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from control.records import NEVER_S

FRAME_LAYOUT = struct.Struct("<IB3x8s")
EXTENDED_FLAG, REMOTE_FLAG, ERROR_FLAG = 0x80000000, 0x40000000, 0x20000000
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFFFFFF
DATA_MAX_BYTES = 8


class Frame(NamedTuple):
    arbitration_id: int
    data: bytes = b""
    is_remote: bool = False
    is_error: bool = False
    is_extended: bool = False
    stamp_s: float = NEVER_S  # monotonic clock when it was on the bus, where the port knows; not among the 16 bytes


def encode_frame(frame: Frame) -> bytes:
    identifier, data, is_remote, is_error, is_extended, _ = frame
    largest = EXTENDED_MASK if is_extended or is_error else STANDARD_MASK
    if not 0 <= identifier <= largest:
        raise ValueError(f"Identifier {identifier:#x} lies outside of 0 to {largest:#x}.")
    if len(data) > DATA_MAX_BYTES:
        raise ValueError(f"A frame holds up to {DATA_MAX_BYTES} bytes, not {len(data)} ({data.hex()}).")
    if is_remote and data:
        raise ValueError(f"A remote frame carries no data, but was given {data.hex()}.")
    flags = is_extended * EXTENDED_FLAG | is_remote * REMOTE_FLAG | is_error * ERROR_FLAG
    return FRAME_LAYOUT.pack(identifier | flags, len(data), data)


def decode_frame(data: bytes) -> Frame:
    if len(data) != FRAME_LAYOUT.size:
        raise ValueError(f"An encoded frame has {FRAME_LAYOUT.size} bytes, not {len(data)}.")
    word, length, payload = FRAME_LAYOUT.unpack(data)
    if length > DATA_MAX_BYTES:
        raise ValueError(f"A frame holds up to {DATA_MAX_BYTES} bytes, not {length}.")
    is_extended = word & EXTENDED_FLAG != 0
    is_remote = word & REMOTE_FLAG != 0
    is_error = word & ERROR_FLAG != 0
    identifier = word & (EXTENDED_MASK if is_extended or is_error else STANDARD_MASK)
    return Frame(identifier, b"" if is_remote else payload[:length], is_remote, is_error, is_extended)
