"""The error of all readers of logs, and how they report progress; for commands that list logs without reading them."""

import struct
from collections.abc import Callable

from mcap.exceptions import McapError

DAMAGE = (McapError, ValueError, RuntimeError, OverflowError, MemoryError, struct.error)  # raised by damaged bytes
ADVICE = "'mudskipper log recover FILE' saves its readable rows"
Watch = Callable[[str, int, int], None]  # called with the work, how much of it is done, and how much there is


class LogError(ValueError):
    """A log that cannot be read: the message names the file, the byte or row, and the reason."""


def unwatched(what: str, done: int, total: int) -> None:
    """Report no progress."""
