"""Says where a log ends early."""

from collections.abc import Sequence
from pathlib import Path

from command_line.screen import complain
from logs.files.stored_logs import is_being_written


def complain_of_end(files: Sequence[Path], complete: bool) -> None:
    """Say that the daemon still writes a log, or that its writer was cut off."""
    if not complete:
        is_written = any(map(is_being_written, files))
        what, until = ("is still being written", "now") if is_written else ("was cut off", "there")
        complain(f"the log {what}: everything up to {until} was read")
