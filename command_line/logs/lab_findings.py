"""What is special to a CSV of the paper's authors: its vertical axis, what the reader noticed in it, its contents."""

from collections.abc import Sequence
from pathlib import Path

from command_line.errors import usage_error
from command_line.screen import complain
from experiments.reports.shown_values import value_shown
from experiments.reports.text_tables import table
from firmware_host.configuration.configuration import CaptureAxis
from logs.lab.body_track import VERTICAL_AXIS
from logs.lab.findings import Finding
from logs.lab.lab_csv import LabLog, is_lab_csv
from logs.lab.summary import lab_summary


def chosen_vertical(given: CaptureAxis | None, file: Path) -> CaptureAxis:
    """Return the axis of the capture that points up. Raises CommandError for a log that has none."""
    if given and not is_lab_csv(file):
        raise usage_error(f"--vertical {given}: {file} is not a CSV log with a motion capture")
    return given or VERTICAL_AXIS


def complain_of(path: Path, findings: Sequence[Finding]) -> None:
    """Print each finding on standard error, with the file."""
    complain(*(f"{path}: {finding}" for finding in findings))


def show_lab_log(path: Path, lab: LabLog) -> None:
    """Print the summary as lines, and the findings as warnings."""
    summary = lab_summary(path, lab)
    print(table([(name, value_shown(value)) for name, value in summary.items() if name != "findings"]))
    complain_of(path, lab.findings)
