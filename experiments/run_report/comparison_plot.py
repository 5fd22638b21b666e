"""Draws speed and coefficients of several runs side by side, mud by mud."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_names import mud_key
from experiments.reports.mud_styles import LABELS, looks_of, mark_of
from experiments.reports.style import STYLE
from experiments.reports.value_text import N_CM3
from experiments.run_report.comparison import ComparedRun
from experiments.run_report.mud_results import MudResult

SIZE_IN, DOTS_PER_INCH = (10.0, 6.0), 120
HEADROOM = 1.12  # for the arrows of bounds
WIDTH = 0.6  # of the runs of one mud, as a fraction of the distance between two muds


def plot_comparison(runs: Sequence[ComparedRun], path: Path) -> Figure:
    """Draw into a PNG, SVG or PDF file; bars are two standard errors, arrows lower bounds."""
    muds = {mud_key(result.mud): result.mud for each in runs for result in each.headline.muds}
    looks = looks_of([each.run.name for each in runs])
    with rc_context(STYLE):
        figure = Figure(figsize=SIZE_IN, layout="constrained")
        has_speed = any(result.motion.speed_m_s is not None for each in runs for result in each.headline.muds)
        quantities = [*["speed"] * has_speed, *COEFFICIENTS]
        axes = figure.subplots(-(-len(quantities) // 2), 2).flatten() if has_speed else figure.subplots(1, 3)
        for panel, name in zip(axes, quantities, strict=True):
            for number, each in enumerate(runs):
                offset = WIDTH * ((number + 0.5) / len(runs) - 0.5)
                for result in each.headline.muds:
                    _mark(panel, list(muds).index(mud_key(result.mud)) + offset, result, name, looks[each.run.name])
            panel.set_ylabel("speed (cm/s)" if name == "speed" else f"{LABELS[name]} (N/cm³)")
            panel.set_xticks(range(len(muds)), [mud.replace(" N/cm³", "") for mud in muds.values()])
            panel.set_xlim(-0.5, max(len(muds), 1) - 0.5)
            panel.set_ylim(min(0.0, panel.get_ylim()[0]), HEADROOM * panel.get_ylim()[1])
        handles = [axes[0].plot([], [], **mark_of(look), linestyle="", label=run)[0] for run, look in looks.items()]
        figure.legend(handles=handles, loc="outside upper center", ncols=min(len(runs), 3), frameon=False)
        figure.savefig(path, dpi=DOTS_PER_INCH)
    return figure


def _mark(panel: Axes, x: float, result: MudResult, name: str, look: dict[str, Any]) -> None:
    if name == "speed":
        value, error, per, is_bound = result.motion.speed_m_s, result.motion.speed_std_error_m_s, 0.01, False
    else:
        gathered = result.both[name]
        value, error, per, is_bound = gathered.value, gathered.std_error, N_CM3, gathered.at_least
    if value is None:
        return
    bar = None if error is None or is_bound else 2.0 * error / per
    panel.errorbar(x, value / per, bar, **mark_of(look), linestyle="")
    if is_bound:
        up = {"arrowstyle": "->", "color": look["color"]}
        panel.annotate(
            "", (x, value / per), xytext=(0, 22), textcoords="offset points", arrowprops=up | {"arrowstyle": "<-"}
        )
