"""Speed of a campaign's walks against each key that varies: a dot for each point, and the means of each value.

Thin lines join the points of a grid that differ in that key alone: where they are not parallel, keys act together.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pandas import DataFrame

from experiments.reports.mud_styles import name_decades
from experiments.reports.style import FAINT, FORWARD, WIDTH_IN
from experiments.reports.text_tables import value_shown

COLUMNS = 3  # of panels
PANEL_IN = 3.0
FEW = 12  # values of a key that share a mean; of more, as in a random sample, each point stands alone
DECADE = 10.0  # between the ends of a key on a logarithmic axis, at least


def draw_speeds(points: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the summaries of the points; bars are the standard deviation over the seeds."""
    keys = list(points[0]["values"])
    columns = min(COLUMNS, len(keys))
    rows = -(-len(keys) // columns)
    figure = Figure(figsize=(WIDTH_IN, PANEL_IN * rows))
    panels: list[Axes] = list(figure.subplots(rows, columns, sharey=True, squeeze=False).flat)
    for panel, key in zip(panels, keys, strict=False):
        _draw_key(panel, key, points)
    for panel in panels[len(keys) :]:
        panel.set_axis_off()
    for panel in panels[::columns]:
        panel.set_ylabel("speed (cm/s)")
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(min(low, 0.0), max(high, 0.0))  # a robot may slide backward
    return figure


def _draw_key(panel: Axes, key: str, points: Sequence[Mapping[str, Any]]) -> None:
    values = [point["values"][key] for point in points]
    is_number = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    x = values if is_number else list(map(name_text, values))  # names have an axis of their own
    speeds, sds = ([100.0 * point[name] for point in points] for name in ("speed_m_s", "speed_sd_m_s"))
    drawn = DataFrame({"x": x, "cm/s": speeds, "sd": sds})
    look: dict[str, Any] = {"linestyle": "", "marker": ".", "color": FAINT, "elinewidth": 0.6, "alpha": 0.7}
    panel.errorbar(drawn["x"], drawn["cm/s"], drawn["sd"].fillna(0.0), **look)
    means = drawn.groupby("x", sort=is_number)["cm/s"].mean()
    if len(means) <= FEW:
        others = [str({name: other for name, other in point["values"].items() if name != key}) for point in points]
        for _, alike in drawn.groupby(others, sort=False):
            panel.plot(alike["x"], alike["cm/s"], color=FAINT, linewidth=0.6, alpha=0.7)
        panel.plot(means.index, means, "o-" if is_number else "o", color=FORWARD)
    if not is_number:
        panel.set_xlim(-0.5, len(means) - 0.5)
    elif drawn["x"].min() > 0.0 and drawn["x"].max() >= DECADE * drawn["x"].min():
        panel.set_xscale("log")
        name_decades(panel.xaxis)
    panel.set_xlabel(key, fontsize="small")


def name_text(value: Any) -> str:
    """Return a value for people, and a file without its folder."""
    return value_shown(value).rpartition("/")[2]
