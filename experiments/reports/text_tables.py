"""Tables and values as plain text, for the screen and for pages that show what the screen showed."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

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


def value_shown(value: Any) -> str:
    """Return yes or no, lists without brackets, floats with four digits or two decimals, and a dash for nothing."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(value_shown, value)) or "-"
    if isinstance(value, dict):
        return ", ".join(f"{name} {value_shown(each)}" for name, each in value.items()) or "-"
    if isinstance(value, float):
        return f"{value:.2f}".removesuffix(".00") if abs(value) >= 100.0 else f"{value:z.4g}"
    return "-" if value in (None, "") else str(value)
