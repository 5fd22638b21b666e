"""Tables as plain text, for the screen and for pages that show what the screen showed."""

from collections.abc import Sequence
from math import isfinite

Rows = Sequence[Sequence[str]]  # the head first


def table(rows: Rows) -> str:
    """Align columns to their widest cell."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def number(value: float | None, digits: int = 3) -> str:
    """Format a value, or a dash for one that is unknown."""
    return "-" if value is None or not isfinite(value) else f"{value:z.{digits}f}"
