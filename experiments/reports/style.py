"""The style of all pictures: colours, the same for the same thing in each, and settings of matplotlib.

What is drawn together differs for colour-blind readers too; a test simulates them.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from logs.files.whole_files import whole_file

WIDTH_IN = 10.0  # of a picture on a page
INK = "#33302c"
FAINT = "#8c867d"  # helper lines and small text
MUD_SHADES = ("#f4eee2", "#e6dac4", "#d6c6a8")  # one after the other along the track
MUD, SURFACE = "#cdb48f", "#8a6d45"  # seen from the side
BODY = "#ece8e1"
FLIPPER_COLOURS = {"left": "#5aa5c4", "right": "#1f6f8b"}
TRAIL = "#b5462f"
PALETTE = (  # C0, C1 ...: Okabe and Ito's, then darker ones
    "#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#56b4e9", "#6b0f1a", "#8c867d", "#b8a200", "#33302c",
)  # fmt: skip
FORWARD, UP, FORCE = "#d55e00", "#0072b2", "#8e24aa"
OUTCOME_COLOURS = {"good": "#0072b2", "slipping": "#e69f00", "stuck": "#6b0f1a", "unknown": FAINT}
STYLE: dict[Any, Any] = {
    "agg.path.chunksize": 1000,  # points: a curve of an hour takes 16 MB where it is drawn at once
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.prop_cycle": f"cycler(color={list(PALETTE)})",
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    "figure.figsize": (WIDTH_IN, 4.5),
    "legend.fontsize": "small",
    "pdf.fonttype": 42,  # TrueType: journals refuse matplotlib's own Type 3
    "savefig.dpi": 120,
    "svg.hashsalt": "mudskipper",  # the same picture has the same bytes
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
}


def say_empty(panel: Any, text: str) -> None:
    """Write in the middle of a panel why it shows nothing."""
    panel.text(0.5, 0.5, text, transform=panel.transAxes, ha="center", va="center", color=FAINT)


def save_picture(draw: Callable[[], Any], path: Path) -> None:
    """Draw a figure of matplotlib in the common style and save it as a PNG, SVG or PDF file."""
    from matplotlib import rc_context  # slow to import

    with rc_context(STYLE), whole_file(path) as hidden:
        draw().savefig(hidden, metadata={"Date": None} if path.suffix == ".svg" else None)
