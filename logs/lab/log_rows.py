"""The rows of one log: their times, lines and phases, from which findings take their place in the file."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.records import Phase
from logs.files.log_error import LogError
from logs.lab.findings import Finding, FindingKind

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Truths = NDArray[np.bool_]

GAIT_PHASES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.SWING)


class LogRows(NamedTuple):
    """What is known of each row besides its signals, and what was noticed so far."""

    path: Path
    time_s: Floats
    line: Integers
    phase: Integers
    findings: list[Finding]

    @property
    def in_gait(self) -> Truths:
        return np.isin(self.phase, GAIT_PHASES)

    def report(self, kind: FindingKind, column: str, row: int, text: str) -> None:
        time_s, line = float(self.time_s[row]), int(self.line[row])
        self.findings.append(Finding(kind, column=column, time_s=time_s, line=line, text=text))

    def refusal(self, kind: FindingKind, column: str, row: int, text: str) -> LogError:
        """Return the error of a log in which every number is wrong."""
        self.report(kind, column, row, text)
        return LogError(f"{self.path}: {self.findings[-1]}")

    def change(self, values: Floats, wanted: Phase) -> Floats:
        """Return the sum of a signal's steps in a phase, column by column; steps from or to NaN do not count."""
        total: Floats = np.nansum(np.diff(values, axis=0)[steps_inside(self.phase, wanted)], axis=0)
        return total

    def strokes(self, wanted: Phase) -> list[slice]:
        """Return the rows of each uninterrupted run of a phase."""
        return runs(self.phase == wanted)


def runs(inside: Truths) -> list[slice]:
    """Return the rows of each uninterrupted run of true values."""
    borders = np.flatnonzero(np.diff(inside.astype(np.int8), prepend=0, append=0))
    return [slice(int(first), int(end)) for first, end in zip(borders[::2], borders[1::2], strict=True)]


def steps_inside(phase: Integers, wanted: Phase) -> Truths:
    """Return which steps from one row to the next begin and end in a phase."""
    inside: Truths = (phase[1:] == wanted) & (phase[:-1] == wanted)
    return inside


def known_range(values: Floats) -> Floats:
    """Return the range of each signal where it is known; negative where it never is."""
    size: Floats = np.nanmax(values, axis=0, initial=-np.inf) - np.nanmin(values, axis=0, initial=np.inf)
    return size
