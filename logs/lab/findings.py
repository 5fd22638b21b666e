"""What the reader notices in a log of the paper's authors: one record for each, with its place in the file."""

import math
from enum import StrEnum
from typing import NamedTuple


class FindingKind(StrEnum):
    TORN_ROW = "torn row"  # dropped
    EMPTY_CELL = "empty cell"  # NaN
    ROW_DROPPED = "row dropped"
    MISSING_SETTING = "missing setting"
    UNKNOWN_STATE = "unknown state"
    TIME = "time"
    STUCK_SIGNAL = "stuck signal"
    RANGE = "range"
    SIGN = "sign"
    NO_MUD = "no mud"
    DEPTH = "depth"
    POSE = "pose"


class Finding(NamedTuple):
    """A peculiarity that invalidates part of a log, or that its reader must know."""

    kind: FindingKind
    column: str  # as the file names it; empty where the finding is not of one column
    time_s: float  # of the first row concerned, on the log's clock; NaN where it is not of a row
    line: int  # of that row in the file; 0 where it is not of a row
    text: str  # with values and units

    def __str__(self) -> str:
        column = [f"column {self.column}"] * bool(self.column)
        line = [f"line {self.line}"] * bool(self.line)
        time = [f"at {self.time_s:.3f} s"] * math.isfinite(self.time_s)
        place = ", ".join(line + column + time)
        return f"{place}: {self.text}" if place else self.text


def of_whole_log(kind: FindingKind, text: str) -> Finding:
    """Return a finding that belongs to no row and no column."""
    return Finding(kind, column="", time_s=math.nan, line=0, text=text)
