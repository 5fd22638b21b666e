"""The message about a log that ends early: its daemon still writes it, or its writer was cut off."""

from collections.abc import Sequence
from pathlib import Path

from command_line.screen import complain
from firmware_host.log.log_file import is_being_written

BEING_WRITTEN = "the log is still being written: everything up to now was read"
CUT_OFF = "the log was cut off: everything up to there was read"


def complain_of_end(files: Sequence[Path], complete: bool) -> None:
    if not complete:
        complain(BEING_WRITTEN if any(map(is_being_written, files)) else CUT_OFF)
