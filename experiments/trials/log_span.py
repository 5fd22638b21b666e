"""What a log holds of a span of time."""

from __future__ import annotations

import numpy as np

from firmware_host.log_reading.log_reader import Log


def cut(log: Log, from_s: float, to_s: float) -> Log:
    """Only the rows between two moments."""
    stamps_s = log.ticks["stamp_s"]
    return log._replace(
        ticks=log.ticks[np.searchsorted(stamps_s, from_s) : np.searchsorted(stamps_s, to_s, side="right")],
        strides=[row for row in log.strides if from_s <= row["stamp_s"] <= to_s],
        events=[row for row in log.events if from_s <= row["stamp_s"] <= to_s],
    )
