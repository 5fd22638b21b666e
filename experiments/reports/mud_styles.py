"""Colours, lines and markers of muds and phases in all pictures, distinct in black and white too."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator

from control.records import Phase
from experiments.reports.mud_names import mud_text
from experiments.reports.style import FAINT, INK
from experiments.reports.value_text import N_CM3

PHASE_SHADES = {Phase.INSERTION: "#d6e6f4", Phase.STANCE: "#dcefd9", Phase.EXTRACTION: "#fbe3cc"}  # as in the paper
PHASE_NAMES = {Phase.INSERTION: "insertion", Phase.STANCE: "stance", Phase.EXTRACTION: "extraction"}
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)))
MARKS = ("o", "s", "^", "D", "v", "P")
ARROW_FRACTION = 0.15  # of a lower bound: the length of its arrow
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


def draw_coefficient(panel: Axes, x: float, found: Any, look: dict[str, Any]) -> None:
    """Draw a mean in N/cm³ with two standard errors; dashes are its trials, and a lower bound has an arrow up.

    `found` has value, std_error and trials, and perhaps at_least.
    """
    if found.value is None:
        return
    value, at_least = found.value / N_CM3, getattr(found, "at_least", False)
    error = ARROW_FRACTION * value if at_least else 2.0 * (found.std_error or 0.0) / N_CM3
    panel.plot([x] * len(found.trials), np.array(found.trials) / N_CM3, "_", color=FAINT, markersize=12)
    panel.errorbar(x, value, error or None, lolims=at_least, capsize=4, ecolor=INK, linestyle="", **mark_of(look))


def name_muds(panel: Axes, muds: Sequence[str], ylabel: str) -> None:
    """Name the muds at 0, 1, 2 ...; the values begin at zero, or at an error bar that reaches below."""
    panel.set_xticks(range(len(muds)), list(map(mud_text, muds)))
    lowest = min(0.0, panel.get_ylim()[0])
    panel.set(xlim=(-0.5, max(len(muds), 1) - 0.5), ylim=(lowest, None), xlabel="mud", ylabel=ylabel)


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
