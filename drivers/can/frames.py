"""One frame of CAN 2.0 or CAN FD, and its bytes as Linux lays out `struct can_frame` and `struct canfd_frame`.

The layouts are those of linux/can.h on a little-endian machine: a 32-bit identifier whose top bits mark extended,
remote and error frames, the length, the flags of CAN FD, two bytes of padding, and 8 or 64 bytes of data. Linux marks a
CAN FD frame by its 72 bytes and by the flag CANFD_FDF. An error frame's identifier contains error class bits and is no
address, so readers check `is_error` first. A remote frame asks for data and carries none; the length that it asks for
is dropped, because no drive here looks at it.
"""

import struct
from typing import NamedTuple

from control.records import NEVER_S

FRAME_LAYOUT, FD_FRAME_LAYOUT = struct.Struct("<IB3x8s"), struct.Struct("<IBB2x64s")
FLAGS_BYTE = 5  # of an encoded frame; zero in CAN 2.0
FD_FORMAT, FD_BIT_RATE_SWITCH = 0x04, 0x01
EXTENDED_FLAG, REMOTE_FLAG, ERROR_FLAG = 0x80000000, 0x40000000, 0x20000000
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFFFFFF
DATA_MAX_BYTES = 8  # of CAN 2.0
FD_LENGTHS = frozenset({*range(9), 12, 16, 20, 24, 32, 48, 64})  # the only ones that CAN FD can express

MalformedMessageError = struct.error  # a payload of another length, or with something that its protocol does not have


class Frame(NamedTuple):
    arbitration_id: int
    data: bytes = b""
    is_remote: bool = False
    is_error: bool = False
    is_extended: bool = False
    stamp_s: float = NEVER_S  # monotonic clock when it was on the bus, where the port knows; not among the bytes
    is_fd: bool = False  # CAN FD, which has no remote frames
    bit_rate_switch: bool = False  # the data of a CAN FD frame is sent at the faster bit rate

    @property
    def is_plain(self) -> bool:
        """Return whether it is a data frame of CAN 2.0 with a standard identifier."""
        return not (self.is_remote or self.is_error or self.is_extended or self.is_fd)


def encode_frame(frame: Frame) -> bytes:
    """Return 16 bytes, or 72 of a CAN FD frame. Raises ValueError for a frame that does not exist on CAN."""
    identifier, data, is_remote, is_error, is_extended, _, is_fd, bit_rate_switch = frame
    largest = EXTENDED_MASK if is_extended or is_error else STANDARD_MASK
    if not 0 <= identifier <= largest:
        raise ValueError(f"Identifier {identifier:#x} lies outside of 0 to {largest:#x}.")
    if is_remote and data:
        raise ValueError(f"A remote frame carries no data, but was given {data.hex()}.")
    word = identifier | is_extended * EXTENDED_FLAG | is_remote * REMOTE_FLAG | is_error * ERROR_FLAG
    if is_fd or bit_rate_switch:
        return _encode_fd(frame, word)
    if len(data) > DATA_MAX_BYTES:
        raise ValueError(f"A frame has up to {DATA_MAX_BYTES} bytes of data, not {len(data)} ({data.hex()}).")
    return FRAME_LAYOUT.pack(word, len(data), data)


def _encode_fd(frame: Frame, word: int) -> bytes:
    if not frame.is_fd or frame.is_remote or frame.is_error:
        raise ValueError("Only CAN FD frames switch the bit rate, and CAN FD has no remote and no error frames.")
    if len(frame.data) not in FD_LENGTHS:
        raise ValueError(f"A CAN FD frame cannot have {len(frame.data)} bytes of data.")
    flags = FD_FORMAT | frame.bit_rate_switch * FD_BIT_RATE_SWITCH
    return FD_FRAME_LAYOUT.pack(word, len(frame.data), flags, frame.data)


def decode_frame(data: bytes) -> Frame:
    """Decode 16 or 72 bytes; raises ValueError for bytes that are no frame."""
    if len(data) == FD_FRAME_LAYOUT.size:
        return _decode_fd(data)
    if len(data) != FRAME_LAYOUT.size:
        raise ValueError(f"An encoded frame has {FRAME_LAYOUT.size} or {FD_FRAME_LAYOUT.size} bytes, not {len(data)}.")
    word, length, payload = FRAME_LAYOUT.unpack(data)
    if length > DATA_MAX_BYTES:
        raise ValueError(f"A frame has up to {DATA_MAX_BYTES} bytes of data, not {length}.")
    is_extended = word & EXTENDED_FLAG != 0
    is_remote = word & REMOTE_FLAG != 0
    is_error = word & ERROR_FLAG != 0
    identifier = word & (EXTENDED_MASK if is_extended or is_error else STANDARD_MASK)
    return Frame(
        arbitration_id=identifier,
        data=b"" if is_remote else payload[:length],
        is_remote=is_remote,
        is_error=is_error,
        is_extended=is_extended,
    )


def _decode_fd(data: bytes) -> Frame:
    word, length, flags, payload = FD_FRAME_LAYOUT.unpack(data)
    if length not in FD_LENGTHS or word & (REMOTE_FLAG | ERROR_FLAG):
        raise ValueError(f"A CAN FD frame cannot have {length} bytes of data, nor be a remote or an error frame.")
    is_extended = word & EXTENDED_FLAG != 0
    return Frame(
        arbitration_id=word & (EXTENDED_MASK if is_extended else STANDARD_MASK),
        data=payload[:length],
        is_extended=is_extended,
        is_fd=True,
        bit_rate_switch=flags & FD_BIT_RATE_SWITCH != 0,
    )


def without_stamps(frames: list[Frame]) -> list[Frame]:
    return [frame._replace(stamp_s=NEVER_S) for frame in frames]
