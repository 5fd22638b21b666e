"""Encodes ROS 2 messages in CDR, little-endian: each number is aligned to its own size."""

import struct
from collections.abc import Sequence

from firmware_host.log.schema import CDR_HEADER


class CdrMessage:
    """Owns the bytes of one message; its methods append fields in the order of the definition."""

    def __init__(self, frame_id: str | None = None, stamp_ns: int = 0) -> None:
        """`frame_id`: the message begins with a std_msgs/Header."""
        self._body = bytearray()
        if frame_id is not None:
            self.header(stamp_ns, frame_id)

    def _align(self, size: int) -> None:
        self._body += bytes(-len(self._body) % size)

    def header(self, stamp_ns: int, frame_id: str) -> None:
        self._align(4)
        self._body += struct.pack("<iI", *divmod(stamp_ns, 1_000_000_000))
        self.text(frame_id)

    def count(self, length: int) -> None:
        """Append the length of a sequence, whose elements follow."""
        self._align(4)
        self._body += struct.pack("<I", length)

    def text(self, text: str) -> None:
        encoded = text.encode() + b"\0"
        self.count(len(encoded))
        self._body += encoded

    def byte(self, value: int) -> None:
        self._body.append(value)

    def numbers(self, *values: float) -> None:
        """Append float64 fields."""
        self._align(8)
        self._body += struct.pack(f"<{len(values)}d", *values)

    def sequence(self, values: Sequence[float]) -> None:
        """Append a float64[] of any length."""
        self.count(len(values))
        if len(values):
            self.numbers(*values)

    def encoded(self) -> bytes:
        return CDR_HEADER + bytes(self._body)
