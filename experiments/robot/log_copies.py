"""Copies of a daemon's log segments that contain any time of an experiment.

A daemon runs for weeks, and at rest its log grows by ten megabytes an hour. Every segment carries the configuration,
its number and both clocks, so the copied ones can be read, replayed and reported without the earlier ones.
"""

from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np

from firmware_host.log.log_folder import present_path
from logs.files.log_reader import Log
from logs.files.scanned_log import scan_log
from logs.files.whole_files import copy_whole
from logs.recovery import recover_log


def copy_since(segments: Sequence[Path], from_s: float, folder: Path) -> list[Path]:
    """Copy the segments that do not end before `from_s`, and complete the open one. Raises LogError, OSError."""
    later = takewhile(lambda log: not _ends_before(log, from_s), reversed(segments))  # a thousand may be before them
    return [_copy(log, folder / log.name) for log in reversed([*later])]


def _ends_before(log: Path, from_s: float) -> bool:
    """Return whether a complete segment has all its rows before `from_s`."""
    rows = scan_log(present_path(log), from_s=from_s)
    if not rows.complete:
        return False
    last_s = [*rows.ends["stamp_s"][-1:], *(row["stamp_s"] for row in (*rows.strides[-1:], *rows.events[-1:]))]
    return bool(last_s) and max(last_s) < from_s


def _copy(log: Path, copy: Path) -> Path:
    copy_whole(present_path(log), copy)
    if not scan_log(copy).complete:
        recover_log(copy)
    return copy


def cut_log(log: Log, from_s: float, to_s: float) -> Log:
    """Return the rows between two times by the robot's clock."""
    stamps_s = log.ticks["stamp_s"]
    return log._replace(
        ticks=log.ticks[np.searchsorted(stamps_s, from_s) : np.searchsorted(stamps_s, to_s, side="right")],
        strides=[row for row in log.strides if from_s <= row["stamp_s"] <= to_s],
        events=[row for row in log.events if from_s <= row["stamp_s"] <= to_s],
    )
