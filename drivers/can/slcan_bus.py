"""A serial port that neither waits nor goes byte by byte, in place of pyserial's below python-can's slcan.

python-can reads an adapter's lines a byte at a time, each with a `select` of up to 1 ms, which an empty port costs in
whole, and after each line that it writes it waits until the bytes have left the computer (tcdrain). A non-blocking
write of pyserial (write_timeout 0) may write half a line without anybody noticing, or try for ever. pyserial opens and
configures the device; here everything that has arrived is read by one call, and a line is written or refused.
"""

from __future__ import annotations

import errno
import os
from typing import Any

REFUSAL = 0x07  # BELL, the adapter's answer to what it does not do
ASCII = bytes(range(128)) + b"?" * 128  # python-can keeps a line with any other byte, and fails on it, for ever


class PromptSerial:
    """Owns what was read and not asked for yet, and the rest of a line of which the kernel took a part."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._file = port.fileno()
        os.set_blocking(self._file, False)
        self._arrived = b""
        self._place = 0  # of the next byte among them
        self._unsent = b""
        self._has_written = False
        self.refusals = 0  # since the first line; before, python-can has closed what was not open, and opened it twice
        self.write_timeout: float | None = None  # python-can sets it

    @property
    def in_waiting(self) -> int:
        """Raises OSError (EIO) where the adapter was unplugged."""
        if self._place == len(self._arrived):
            self._fetch()
        return len(self._arrived) - self._place

    def _fetch(self) -> None:
        self._arrived, self._place = b"", 0
        waiting = self._port.in_waiting  # asked for first: as pyserial sets the line up, an empty read is no end of it
        if waiting:
            self._arrived = os.read(self._file, waiting).translate(ASCII)
            if self._has_written:
                self.refusals += self._arrived.count(REFUSAL)

    def read(self, size: int = 1) -> bytes:
        """Of what `in_waiting` has found; less, or nothing, where there is no more."""
        begin = self._place
        self._place = min(begin + size, len(self._arrived))
        return self._arrived[begin : self._place]

    def write(self, line: bytes) -> None:
        """Raises BlockingIOError, and writes nothing of this line, while the kernel takes no more."""
        self._has_written = True
        if self._unsent:
            self._unsent = self._unsent[os.write(self._file, self._unsent) :]
        if self._unsent:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        self._unsent = line[os.write(self._file, line) :]

    def flush(self) -> None:
        """Nothing waits here."""

    def fileno(self) -> int:
        return int(self._file)

    def close(self) -> None:
        self._port.close()
