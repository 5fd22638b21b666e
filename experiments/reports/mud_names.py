"""Names of muds: most are their water in percent, some their strength with the unit, others free."""

import re

WATER = re.compile(r"(?:w\s*=?\s*)?(\d+(?:\.\d+)?)\s*%?")  # 47.6, 47.6%, w47.6 or w = 47.6 %


def mud_name(name: str) -> str:
    """Return the number of a water content however it is written, and any other name as it is."""
    water = WATER.fullmatch(name.strip())
    return water[1] if water else name.strip() or name


def mud_key(name: str) -> str:
    """Return a key for comparison: 48.60 and "w = 48.6 %" are one mud, and so are Pond and pond."""
    water = WATER.fullmatch(name.strip())
    return f"{float(water[1]):g}" if water else name.strip().casefold()


def file_part(name: str) -> str:
    """Return a name as a part of a file's name."""
    return re.sub(r"[^\w.]+", "_", name)


def mud_label(name: str) -> str:
    """Format for a table's head or an axis."""
    water = WATER.fullmatch(name)
    return f"w = {water[1]} %" if water else name


def mud_text(name: str) -> str:
    """Format within text; some names have a position."""
    mud, at, position = name.partition(" at ")
    water = WATER.fullmatch(mud)
    return f"{water[1]} %{at}{position}" if water else name
