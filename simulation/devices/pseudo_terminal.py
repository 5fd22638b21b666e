"""A pseudo-terminal that stands in for a serial adapter: a device writes to one end, any program opens the other.

A link with a fixed name, as under /dev/serial/by-id, points to the program's end while the device is plugged in. What
finds the program's buffer full is lost, as on a real line without a reader.
"""

import fcntl
import os
import struct
import termios
import tty
from contextlib import suppress
from pathlib import Path


class PseudoTerminal:
    """Owns both ends. `device` is the path of the program's end."""

    def __init__(self, link: Path | None = None) -> None:
        """Raise FileExistsError where the link's name is taken."""
        self._master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self.slave)
        self.link = link
        if link is not None:
            try:
                link.symlink_to(self.device)
            except OSError:
                self._close_ends()
                raise

    def write(self, data: bytes) -> int:
        """Return how many bytes the program's buffer took."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def read(self) -> bytes:
        """Return what the program has written since."""
        with suppress(BlockingIOError):
            return os.read(self._master, 65536)
        return b""

    @property
    def unread_bytes(self) -> int:
        """The number of written bytes that the program can read; a pseudo-terminal delivers a moment later."""
        (count,) = struct.unpack("i", fcntl.ioctl(self.slave, termios.FIONREAD, bytes(4)))
        return int(count)

    def close(self) -> None:
        if self.link is not None:
            self.link.unlink(missing_ok=True)
        self._close_ends()

    def _close_ends(self) -> None:
        for end in (self._master, self.slave):
            with suppress(OSError):
                os.close(end)
