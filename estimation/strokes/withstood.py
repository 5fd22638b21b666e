"""What mud withstood: the lower bound that a stroke gives where the mud did not yield."""

from collections.abc import Sequence
from math import isfinite

from estimation.strokes.origin_fit import median

SHALLOWEST_M = 0.005  # a shallower stride or batch measures the surface, not the mud


def most_withstood(withstood: Sequence[float], count: int) -> tuple[float, float] | None:
    """Return the greatest median of `count` batches in a row, and their range; None without so many known ones."""
    rows = [withstood[i : i + count] for i in range(len(withstood) - count + 1)]
    known = [row for row in rows if row and all(isfinite(k) for k in row)]
    return max([(median(row), max(row) - min(row)) for row in known], default=None)
