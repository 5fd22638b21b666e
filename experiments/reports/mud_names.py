"""What muds are called: most by their water in percent, some by their strength with the unit, a person's at will."""

from __future__ import annotations

import re

WATER = re.compile(r"(?:w\s*=?\s*)?(\d+(?:\.\d+)?)\s*%?")  # 47.6, 47.6%, w47.6 or w = 47.6 %


def mud_name(name: str) -> str:
    """However a water content is written, its number; any other name as it is."""
    water = WATER.fullmatch(name.strip())
    return water[1] if water else name.strip() or name


def mud_key(name: str) -> str:
    """By what one mud is found in two files: 48.60 and "w = 48.6 %" are one, and so are Pond and pond."""
    water = WATER.fullmatch(name.strip())
    return f"{float(water[1]):g}" if water else name.strip().casefold()


def mud_label(name: str) -> str:
    """For a table's head or an axis."""
    water = WATER.fullmatch(name)
    return f"w = {water[1]} %" if water else name


def mud_text(name: str) -> str:
    """Within a sentence; some say where they lie."""
    mud, at, place = name.partition(" at ")
    water = WATER.fullmatch(mud)
    return f"{water[1]} %{at}{place}" if water else name
