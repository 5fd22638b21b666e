"""Colours, lines and markers of muds and phases in all pictures, distinct in black and white too."""

from collections.abc import Sequence
from typing import Any

from matplotlib import colormaps
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator

from control.records import Phase

INK, GREY = "#222222", "#8a8a8a"
PHASE_SHADES = {Phase.INSERTION: "#d6e6f4", Phase.STANCE: "#dcefd9", Phase.EXTRACTION: "#fbe3cc"}  # as in the paper
PHASE_NAMES = {Phase.INSERTION: "insertion", Phase.STANCE: "stance", Phase.EXTRACTION: "extraction"}
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)))
MARKS = ("o", "s", "^", "D", "v", "P")
DOTS_PER_INCH = 110
LABELS = {"k_p": "$k_p$ penetration", "k_s": "$k_s$ shear", "k_e": "$k_e$ extraction"}


def looks_of(muds: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return colour, line and marker of each mud, from dark to light."""
    colours = colormaps["viridis"]
    fraction = max(len(muds) - 1, 1) / 0.85
    return {
        mud: {"color": colours(i / fraction), "linestyle": LINES[i % len(LINES)], "marker": MARKS[i % len(MARKS)]}
        for i, mud in enumerate(muds)
    }


def line_of(look: dict[str, Any]) -> dict[str, Any]:
    return {"color": look["color"], "linestyle": look["linestyle"], "linewidth": 1.4}


def mark_of(look: dict[str, Any]) -> dict[str, Any]:
    return {"color": look["color"], "marker": look["marker"], "markersize": 7.0, "markeredgecolor": INK}


def name_decades(axis: Axis) -> None:
    """Write plain numbers at 1, 2 and 5 of each decade of a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def waters_of(muds: Sequence[str]) -> list[float] | None:
    """Return the water contents; None where a mud has another name."""
    try:
        return [float(mud) for mud in muds]
    except ValueError:
        return None


def file_name(mud: str) -> str:
    """Return a name that is safe as a part of a file's."""
    return "".join(letter if letter.isalnum() or letter in ".-" else "_" for letter in mud)
