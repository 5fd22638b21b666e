"""A rail encoder's counter on a pseudo-terminal: it writes the count of a place as an ASCII line, and can be unplugged.

Which device a robot is told stays the same when it is plugged in again, as a link under /dev/serial/by-id does.
"""

from __future__ import annotations

import os
import tty
from contextlib import suppress
from pathlib import Path


class EmulatedRailEncoder:
    """Owns the pseudo-terminal behind the link `device`, and which count is zero."""

    def __init__(self, device: Path, metres_per_count: float, label: str = "", line_end: str = "\r\n") -> None:
        self.device = device
        self.metres_per_count, self.label, self.line_end = metres_per_count, label, line_end
        self.lost_lines = 0  # that found the computer's buffer full
        self._files: tuple[int, ...] = ()
        self.plug_in()

    def plug_in(self, position_m: float = 0.0) -> None:
        """A counter begins at zero, wherever it is."""
        self._zero_m = position_m
        self._files = os.openpty()
        tty.setraw(self._files[1])
        os.set_blocking(self._files[0], False)
        self.device.symlink_to(os.ttyname(self._files[1]))

    def send(self, position_m: float) -> None:
        self.write(f"{self.label}{round((position_m - self._zero_m) / self.metres_per_count)}{self.line_end}".encode())

    def write(self, data: bytes) -> None:
        """Whatever a bad contact makes of a line."""
        try:
            os.write(self._files[0], data)
        except BlockingIOError:
            self.lost_lines += 1

    def unplug(self) -> None:
        self.device.unlink(missing_ok=True)
        for file in self._files:
            with suppress(OSError):
                os.close(file)
        self._files = ()
