"""Draws numbers as columns of blocks over their range, which is no smaller than a floor."""

from collections.abc import Sequence

BARS = "▁▂▃▄▅▆▇█"


def bars(values: Sequence[float | None], floor: float, height: int = 1) -> list[str]:
    """Return lines with one column for each value, a blank one for None; the full height is at least `floor`."""
    known = [value for value in values if value is not None]
    low = min(known, default=0.0)
    span = max(max(known, default=0.0) - low, floor) or 1.0
    steps = len(BARS) * height
    levels = [-1 if value is None else min(int((value - low) / span * steps), steps - 1) for value in values]
    return ["".join(_block(level - len(BARS) * line) for level in levels) for line in reversed(range(height))]


def _block(level: int) -> str:
    """Return the part of a column in a line, in which it has `level` as its top."""
    return " " if level < 0 else BARS[min(level, len(BARS) - 1)]
