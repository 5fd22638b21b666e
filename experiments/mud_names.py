"""What muds are called: most by their water in percent, some by their strength with the unit, a person's at will."""

from __future__ import annotations


def mud_name(name: str) -> str:
    """However a water content is written: 47.6, w = 47.6 % or 47.6%."""
    return name.removeprefix("w").replace("=", "").replace("%", "").strip() or name


def mud_label(name: str) -> str:
    """For a table's head or an axis."""
    return f"w = {name} %" if name[-1:].isdigit() else name


def mud_text(name: str) -> str:
    """Within a sentence; some say where they lie."""
    mud, _, place = name.partition(" at ")
    return f"{mud} %{' at ' if place else ''}{place}" if mud[-1:].isdigit() else name
