"""Prints what the reader noticed in a CSV of the paper's authors, and what such a file contains."""

from collections.abc import Sequence
from pathlib import Path

from command_line.screen import complain
from experiments.reports.shown_values import value_shown
from experiments.reports.text_tables import table
from firmware_host.log_reading.lab.findings import Finding
from firmware_host.log_reading.lab.summary import lab_summary
from firmware_host.log_reading.lab_csv import LabLog


def complain_of(path: Path, findings: Sequence[Finding]) -> None:
    """Prints each finding on standard error, with the file."""
    complain(*(f"{path}: {finding}" for finding in findings))


def show_lab_log(path: Path, lab: LabLog) -> None:
    """Prints the summary as lines, and the findings as warnings."""
    summary = lab_summary(path, lab)
    print(table([(name, value_shown(value)) for name, value in summary.items() if name != "findings"]))
    complain_of(path, lab.findings)
