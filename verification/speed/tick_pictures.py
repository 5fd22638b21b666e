"""Pictures of the ticks of a walk on a slower computer, in periods, and of the parts of a tick."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from control.rate import PERIOD_S
from verification.walks.walk_ticks import WalkTick

SHOWN_S = 5.0  # some three strides
INK, END, FAINT = "#222222", "#c44e52", "#999999"
PARTS = {  # of a tick, with their stages and colours
    "reading": (("read", "pose"), "#0072b2"),
    "estimate": (("estimate", "adapt"), "#e69f00"),
    "monitors": (("mode",), "#c44e52"),
    "command": (("controller", "limits", "command"), "#009e73"),
    "log": (("learn", "record"), "#999999"),
}


def require_matplotlib() -> None:
    """Ends the benchmark before it measures where it could not draw."""
    if not find_spec("matplotlib"):
        raise SystemExit("--picture needs matplotlib: pip install 'mudskipper[plots]'")


def fractions_of(stages_us: Mapping[str, float]) -> dict[str, float]:
    """Returns what each part takes of a tick."""
    whole_us = sum(stages_us.values())
    return {part: sum(stages_us[stage] for stage in stages) / whole_us for part, (stages, _) in PARTS.items()}


def plot_parts(stages_us: Mapping[str, Mapping[str, float]], path: Path) -> None:
    """Draws a bar for each kind of bus; `stages_us` are medians by bus and stage."""
    from matplotlib.figure import Figure  # slow to import

    figure = Figure(figsize=(8.0, 0.9 + 0.5 * len(stages_us)), layout="constrained")
    panel = figure.add_subplot()
    for bus, stages in reversed(list(stages_us.items())):
        left = 0.0
        for part, fraction in fractions_of(stages).items():
            bar = panel.barh(bus, fraction, left=left, color=PARTS[part][1])
            panel.bar_label(bar, [f"{part}\n{fraction:.0%}"], label_type="center", size=7, color="white")
            left += fraction
    panel.set(xlim=(0.0, 1.0), xlabel="fraction of a tick")
    panel.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)


def plot_ticks(ticks: Sequence[WalkTick], factor: float, path: Path) -> None:
    """Draws the work of each tick times the factor, those of a stride's ends in a colour of their own."""
    from matplotlib.figure import Figure  # slow to import

    shown = ticks[: round(SHOWN_S / PERIOD_S)]
    figure = Figure(figsize=(8.0, 2.6), layout="constrained")
    panel = figure.add_subplot()
    for at_end, colour, label in ((False, FAINT, "other ticks"), (True, END, "ends of insertions and strides")):
        own = [(number, tick) for number, tick in enumerate(shown) if tick.at_end is at_end]
        times_s, periods = [n * PERIOD_S for n, _ in own], [factor * tick.worked_s / PERIOD_S for _, tick in own]
        panel.plot(times_s, periods, ".", markersize=2.5, color=colour, label=label)
    panel.axhline(1.0, color=INK, linewidth=0.8)
    panel.set(xlabel="time (s)", ylabel=f"tick × {factor:g}\n(periods)", xlim=(0.0, SHOWN_S), ylim=(0.0, None))
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(loc="upper right", frameon=False, markerscale=3.0, fontsize=8, ncols=2)
    figure.savefig(path)
