"""A serial port that never waits, which replaces pyserial's port under python-can's slcan interface.

python-can reads an adapter's lines byte by byte, each with a `select` of up to 1 ms, so an empty port costs 1 ms. After
each line that it writes, python-can waits until the bytes have left the computer (tcdrain). A non-blocking write of
pyserial (write_timeout 0) may write half a line without reporting it, or retry forever. Here pyserial only opens and
configures the device: one call reads everything that has arrived, and a line is written as a whole or refused.
"""

import errno
import os
from typing import Any

REFUSAL = 0x07  # BELL, the adapter's answer to a command that it does not execute
ASCII = bytes(range(128)) + b"?" * 128  # python-can would fail forever on a line with any other byte


class SlcanSerial:
    """Owns the bytes that python-can has not asked for yet, and the rest of a line that was written in part."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._file = port.fileno()
        os.set_blocking(self._file, False)
        self._arrived = b""
        self._position = 0  # of the next byte among them
        self._unsent = b""
        self._has_written = False
        self.refusals = 0  # since the first line; python-can's own opening sequence causes some before
        self.write_timeout: float | None = None  # python-can sets it

    @property
    def in_waiting(self) -> int:
        """The number of bytes that wait; raises OSError (EIO) where the adapter was unplugged."""
        if self._position == len(self._arrived):
            self._fetch()
        return len(self._arrived) - self._position

    def _fetch(self) -> None:
        self._arrived, self._position = b"", 0
        waiting = self._port.in_waiting  # first, because an empty read does not mean that the device is gone
        if waiting:
            self._arrived = os.read(self._file, waiting).translate(ASCII)
            if self._has_written:
                self.refusals += self._arrived.count(REFUSAL)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` of the bytes that `in_waiting` has found."""
        begin = self._position
        self._position = min(begin + size, len(self._arrived))
        return self._arrived[begin : self._position]

    def write(self, line: bytes) -> None:
        """Write a line; raises BlockingIOError and writes nothing of it while the kernel's buffer is full."""
        self._has_written = True
        if self._unsent:
            self._unsent = self._unsent[os.write(self._file, self._unsent) :]
        if self._unsent:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        self._unsent = line[os.write(self._file, line) :]

    def flush(self) -> None:
        """Does nothing: no bytes wait here."""

    def fileno(self) -> int:
        return int(self._file)

    def close(self) -> None:
        self._port.close()
