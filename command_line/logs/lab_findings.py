"""Prints what the reader noticed in a CSV of the paper's authors, and what such a file contains."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from command_line.screen import complain
from firmware_host.log_reading.lab.findings import Finding
from firmware_host.log_reading.lab.summary import lab_summary
from firmware_host.log_reading.lab_csv import LabLog


def complain_of(path: Path, findings: Sequence[Finding]) -> None:
    """Prints each finding on standard error, with the file."""
    complain(*(f"{path}: {finding}" for finding in findings))


def show_lab_log(path: Path, lab: LabLog) -> None:
    """Prints the summary as lines, and the findings as warnings."""
    for name, value in lab_summary(path, lab).items():
        if name != "findings":
            print(f"{name:16} {_shown(value)}")
    complain_of(path, lab.findings)


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {number:g}" for name, number in value.items()) or "-"
    if isinstance(value, list):
        return ", ".join(value) or "-"
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
