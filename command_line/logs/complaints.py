"""What is wrong with a log besides its errors: its early end, and what the reader of a CSV of the authors noticed."""

from collections.abc import Sequence
from pathlib import Path

from command_line.errors import usage_error
from command_line.screen import complain
from firmware_host.configuration.configuration import CaptureAxis
from logs.files.stored_logs import is_being_written
from logs.lab.body_track import VERTICAL_AXIS
from logs.lab.findings import Finding
from logs.lab.lab_csv import is_lab_csv


def chosen_vertical(given: CaptureAxis | None, file: Path) -> CaptureAxis:
    """Return the axis of the capture that points up. Raises CommandError for a log that has none."""
    if given and not is_lab_csv(file):
        raise usage_error(f"--vertical {given}: {file} is not a CSV log with a motion capture")
    return given or VERTICAL_AXIS


def complain_of(path: Path, findings: Sequence[Finding]) -> None:
    """Print each finding on standard error, with the file."""
    complain(*(f"{path}: {finding}" for finding in findings))


def complain_of_end(files: Sequence[Path], complete: bool) -> None:
    """Say that the daemon still writes a log, or that its writer was cut off."""
    if not complete:
        is_written = any(map(is_being_written, files))
        what, until = ("is still being written", "now") if is_written else ("was cut off", "there")
        complain(f"the log {what}: everything up to {until} was read")
