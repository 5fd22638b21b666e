"""A picture of the ticks of a walk on a slower computer, in periods."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.walks.walk_ticks import WalkTick
from control.rate import PERIOD_S

SHOWN_S = 5.0  # some three strides
INK, END, FAINT = "#222222", "#c44e52", "#999999"


def plot_ticks(ticks: Sequence[WalkTick], factor: float, path: Path) -> None:
    """Draws the work of each tick times the factor, those of a stride's ends in a colour of their own."""
    from matplotlib.figure import Figure  # slow to import

    shown = ticks[: round(SHOWN_S / PERIOD_S)]
    figure = Figure(figsize=(8.0, 2.6), layout="constrained")
    panel = figure.add_subplot()
    for at_end, colour, label in ((False, FAINT, "other ticks"), (True, END, "ends of insertions and strides")):
        points = [(n * PERIOD_S, factor * t.worked_s / PERIOD_S) for n, t in enumerate(shown) if t.at_end is at_end]
        panel.plot(*zip(*points, strict=True), ".", markersize=2.5, color=colour, label=label)
    panel.axhline(1.0, color=INK, linewidth=0.8)
    panel.set(xlabel="time (s)", ylabel=f"tick × {factor:g}\n(periods)", xlim=(0.0, SHOWN_S), ylim=(0.0, None))
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(loc="upper right", frameon=False, markerscale=3.0, fontsize=8, ncols=2)
    figure.savefig(path)
