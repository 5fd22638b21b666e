"""Formats values of summaries and queries for people."""

from typing import Any


def value_shown(value: Any) -> str:
    """Return yes or no, lists without brackets, floats with four digits or two decimals, and a dash for nothing."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(value_shown, value)) or "-"
    if isinstance(value, dict):
        return ", ".join(f"{name} {value_shown(each)}" for name, each in value.items()) or "-"
    if isinstance(value, float):
        return f"{value:.2f}" if abs(value) >= 100.0 else f"{value:.4g}"
    return "-" if value in (None, "") else str(value)
