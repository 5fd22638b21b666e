"""Counts the rows of a run in its log files: ticks are numbered, and count the missed ones."""

from pathlib import Path
from typing import Any

import numpy as np

from firmware_host.log.log_folder import ACTIVE, DONE, log_files
from logs.files.log_reader import read_log


def count_rows(logs: Path) -> dict[str, Any]:
    read = [read_log(path) for path in log_files(logs, ACTIVE, DONE)]
    ticks = np.concatenate([log.ticks[["tick", "missed_ticks", "stamp_s"]] for log in read])
    numbers = ticks["tick"].astype(np.int64) - ticks["missed_ticks"].astype(np.int64)
    return {
        "files": len(read),
        "files_not_whole": sum(not log.complete for log in read),
        "ticks_in_files": len(ticks),
        "ticks_missing": int(np.abs(np.diff(numbers) - 1).sum()),  # or doubled
        "last_s": float(ticks["stamp_s"][-1]),
    }
