"""Plots forces, coefficients, depth, position and steps of a walk against time, after the paper's figure 8.

The paper shades the muds that the experimenters prepared, and so does the demo, which knows its track.
mud_layout.py says where the names come from. The flippers stand side by side, with the same scales.
"""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import ArrayLike

from experiments.pictures.colours import FAINT, FLIPPER_COLOURS, FORWARD, INK, MUD_SHADES, OUTCOME_COLOURS, SURFACE, UP
from experiments.pictures.mud_layout import MudLayout, MudRegion, mud_regions
from experiments.pictures.recorded_walk import Floats, RecordedWalk
from experiments.pictures.stride_choice import Outcome, outcome_of
from experiments.pictures.walk_trace import rows_of_curve
from experiments.reports.error_table import COEFFICIENTS

WIDTH_IN, PANEL_IN, DOTS_PER_INCH = 10.0, 1.55, 120
TITLE_HEIGHT = 1.3  # above the names of the muds, in heights of a panel
MOST_DASHES = 20  # of noticed muds; more would cover the curves
DASHES: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (2, 2))}
MARKS: dict[str, Any] = {"color": INK, "linestyle": "", "marker": "|", "markersize": 9.0, "markeredgewidth": 0.7}
SHORTEST_S = 0.1  # least length of the time axis
ROOM_FOR_LETTER = 0.018  # of the width of a panel
HEADROOM = 1.6  # top of a panel as a multiple of its largest value; error bars may be cut
LEGEND: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 0.95),
    "fontsize": "x-small",
    "frameon": False,
    "columnspacing": 1.2,
    "handlelength": 1.5,
}
STYLE: dict[Any, Any] = {
    "agg.path.chunksize": 1000,  # points: a curve of an hour takes 16 MB where it is drawn at once
    "pdf.fonttype": 42,  # TrueType: journals refuse matplotlib's own Type 3
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
}
Draw = Callable[[Axes, RecordedWalk], None]
Panels = list[tuple[str, Draw]]


def plot_walk(walk: RecordedWalk, path: Path, layout: MudLayout | None = None) -> Figure:
    """Draw a walk into a PNG, SVG or PDF file."""
    figure = draw_walk(walk, layout)
    with rc_context(STYLE):
        figure.savefig(path, dpi=DOTS_PER_INCH)
    return figure


def draw_walk(walk: RecordedWalk, layout: MudLayout | None = None) -> Figure:
    """Draw a walk, each flipper in a column. `layout` names the muds where it is known."""
    sides, own, of_body = walk.sides, _flipper_panels(), _body_panels(walk)
    rows = len(own) + -(-len(of_body) // len(sides))
    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, PANEL_IN * rows + 0.6), layout="constrained")
        axes = _make_panels(figure, rows, len(sides), len(own))
        for column, side in enumerate(sides):
            for panel, (_, draw) in zip(axes[:, column], own, strict=False):
                draw(panel, side)
            axes[0, column].set_title(f"{side.flipper} flipper", y=TITLE_HEIGHT, weight="bold")
        for panel, (label, _) in zip(axes[:, 0], own, strict=False):
            panel.set_ylabel(label)
        spare = axes[len(own) :].flatten()
        for panel, (label, draw) in zip(spare, of_body, strict=False):
            draw(panel, walk)
            panel.set_ylabel(label)
        _finish(figure, axes, walk, mud_regions(walk, layout))
    return figure


def _make_panels(figure: Figure, rows: int, columns: int, shared_rows: int) -> Any:
    """Return panels with a common time axis, and in the first rows with a common scale for both flippers."""
    grid, axes = figure.add_gridspec(rows, columns), np.empty((rows, columns), dtype=object)
    for row, column in np.ndindex(rows, columns):
        is_shared = column > 0 and row < shared_rows
        panel = figure.add_subplot(grid[row, column], sharex=axes[0, 0], sharey=axes[row, 0] if is_shared else None)
        panel.tick_params(labelleft=not is_shared, labelbottom=row == rows - 1)
        axes[row, column] = panel
    return axes


def _finish(figure: Figure, axes: Any, walk: RecordedWalk, regions: list[MudRegion]) -> None:
    for panel in figure.axes:
        _shade(panel, regions, walk.noticed_s)
    for panel in axes[0]:
        _name_muds(panel, regions, float(walk.time_s[-1]))
    axes[0, 0].set_xlim(0.0, max(float(walk.time_s[-1]), SHORTEST_S))
    for panel in axes[-1]:
        panel.set_xlabel("time (s)")
    axes[-1, -1].set_title(walk.title, y=-0.5, loc="right", size=8, color=FAINT)
    figure.align_ylabels()


def _flipper_panels() -> Panels:
    panels: Panels = [("force (N)", _plot_forces)]
    panels += [(f"${name}$ (N/cm³)", partial(_plot_coefficient, name=name)) for name in COEFFICIENTS]
    return [*panels, ("depth (cm)", _plot_depth)]


def _body_panels(walk: RecordedWalk) -> Panels:
    """Return the panels of the body, where the log has its position."""
    if not np.any(np.isfinite(walk.body_x_m)):
        return []
    return [("body (m)", _plot_position), ("step (cm)", _plot_steps)]


def _shade(panel: Axes, regions: list[MudRegion], noticed_s: list[float]) -> None:
    across: dict[str, Any] = {"transform": panel.get_xaxis_transform()}  # from the bottom to the top
    for number, shade in enumerate(MUD_SHADES):
        own = regions[number :: len(MUD_SHADES)]
        starts_s, ends_s = [region.start_s for region in own], [region.end_s for region in own]
        panel.add_artist(_boxes(starts_s, ends_s, np.ones(len(own)), color=shade, zorder=0, **across))
    bottoms, tops = np.zeros(len(noticed_s)), np.ones(len(noticed_s))
    if len(noticed_s) > MOST_DASHES:
        panel.add_artist(Line2D(noticed_s, tops, **MARKS, **across))
    else:
        panel.add_artist(_uprights(noticed_s, bottoms, tops, **DASHES, **across))


def _boxes(starts: ArrayLike, ends: ArrayLike, heights: Floats, **look: Any) -> PathPatch:
    """Return boxes that stand on zero as one artist: one of its own for each takes ten kilobytes."""
    zeros = np.zeros_like(heights)
    x, y = np.column_stack([starts, starts, ends, ends, ends]), np.column_stack([zeros, heights, heights, zeros, zeros])
    codes = np.tile([Outline.MOVETO, *[Outline.LINETO] * 3, Outline.CLOSEPOLY], len(heights))
    return PathPatch(Outline(np.dstack([x, y]).reshape(-1, 2), codes), linewidth=0, **look)


def _uprights(at: ArrayLike, low: Floats, high: Floats, **look: Any) -> Line2D:
    """Return vertical lines as one artist."""
    y = np.column_stack([low, high, np.full_like(low, np.nan)])
    return Line2D(np.repeat(at, y.shape[1]), y.ravel(), solid_capstyle="butt", **look)


def _name_muds(panel: Axes, regions: list[MudRegion], length_s: float) -> None:
    """Write the names of the muds above the panel's legend, where there is room for them."""
    above: dict[str, Any] = {
        "xycoords": ("data", "axes fraction"),
        "xytext": (0.0, 16.0),
        "textcoords": "offset points",
    }
    for start_s, end_s, name in regions:
        short = name.removesuffix(" N/cm³").replace("k_p", "$k_p$")
        if end_s - start_s > ROOM_FOR_LETTER * len(short) * length_s:
            panel.annotate(short, ((start_s + end_s) / 2.0, 1.0), ha="center", size=8, annotation_clip=False, **above)


def _plot_curve(panel: Axes, walk: RecordedWalk, values: Floats, **look: Any) -> None:
    """Draw the rows of a long walk that this curve needs: matplotlib takes a kilobyte for each."""
    rows = slice(None) if walk.source is None else rows_of_curve(walk.time_s, values)
    panel.plot(walk.time_s[rows], values[rows], **look)


def _plot_forces(panel: Axes, walk: RecordedWalk) -> None:
    _plot_curve(panel, walk, walk.force_x_n, color=FORWARD, linewidth=0.8, label="$f_x$ forward")
    _plot_curve(panel, walk, walk.force_z_n, color=UP, linewidth=0.8, label="$f_z$ up")
    panel.legend(ncols=2, **LEGEND)


def _explain_coefficients(panel: Axes, walk: RecordedWalk) -> None:
    """Explain the marks in the panels of coefficients that occur."""
    if any(stride[f"{name}_at_least"] for name in COEFFICIENTS for stride in walk.own_strides):
        panel.plot([], [], "^", color=FAINT, label="lower bound")
    if any(not stride[f"{name}_valid"] for name in COEFFICIENTS for stride in walk.own_strides):
        panel.plot([], [], "o", color=FAINT, markerfacecolor="white", label="not valid")
    if walk.noticed_s:
        look = MARKS if len(walk.noticed_s) > MOST_DASHES else DASHES
        panel.plot([], [], **look, label="another mud noticed")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(ncols=3, **LEGEND)


def _plot_coefficient(panel: Axes, walk: RecordedWalk, name: str) -> None:
    """Draw values as dots, lower bounds as triangles, invalid ones hollow; bars are two standard errors."""
    colour = FLIPPER_COLOURS[walk.flipper]
    known = [stride for stride in walk.own_strides if np.isfinite(stride[name])]
    for at_least, valid in product((False, True), repeat=2):  # one artist for each mark: an hour has 5000 values
        marked = [s for s in known if (bool(s[f"{name}_at_least"]), bool(s[f"{name}_valid"])) == (at_least, valid)]
        if not marked:
            continue
        stamps_s, values, errors = (
            np.array([stride[key] for stride in marked]) for key in ("stamp_s", name, f"{name}_std_error")
        )
        low, high = (values - 2.0 * errors) / 1e6, (values + 2.0 * errors) / 1e6
        panel.add_artist(_uprights(stamps_s, low, high, color=colour, linewidth=1.2))
        look: dict[str, Any] = {
            "color": colour,
            "markerfacecolor": colour if valid else "white",
            "zorder": 2.1,  # above the lines
        }
        panel.plot(stamps_s, values / 1e6, "^" if at_least else "o", markersize=5, **look)
    largest = max((stride[name] / 1e6 for stride in walk.strides if np.isfinite(stride[name])), default=0.0)
    panel.set_ylim(0.0, HEADROOM * largest if largest > 0.0 else 1.0)
    if name == COEFFICIENTS[0]:
        _explain_coefficients(panel, walk)


def _plot_depth(panel: Axes, walk: RecordedWalk) -> None:
    colour = FLIPPER_COLOURS[walk.flipper]
    _plot_curve(panel, walk, 100.0 * walk.depth_m, color=colour, linewidth=1.0, label="measured")
    _plot_curve(panel, walk, 100.0 * walk.depth_command_m, color=INK, linewidth=0.8, label="commanded")
    chosen_m = {s["stamp_s"]: s["chosen_depth_m"] for s in walk.own_strides if np.isfinite(s["chosen_depth_m"])}
    if chosen_m:
        chosen_cm = [100.0 * depth_m for depth_m in chosen_m.values()]
        panel.plot(list(chosen_m), chosen_cm, "v", color=INK, label="chosen for the next stride")
    stuck_s = [stride["stamp_s"] for stride in walk.own_strides if not stride["released"]]
    if stuck_s:
        stuck_cm = 100.0 * np.interp(stuck_s, walk.time_s, walk.depth_m)
        panel.plot(stuck_s, stuck_cm, "x", color=OUTCOME_COLOURS[Outcome.STUCK], markeredgewidth=2.0, label="stuck")
    panel.axhline(0.0, color=SURFACE, linewidth=1.0)
    panel.yaxis.set_inverted(True)
    panel.legend(ncols=4, **LEGEND)


def _plot_position(panel: Axes, walk: RecordedWalk) -> None:
    _plot_curve(panel, walk, walk.body_x_m, color=INK, linewidth=1.2)


def _plot_steps(panel: Axes, walk: RecordedWalk) -> None:
    """Draw a bar from the start of each stride to its end, in the colour of its outcome."""
    known = [stride for stride in walk.own_strides if np.isfinite(stride["step_m"])]
    for outcome in Outcome:
        own = [stride for stride in known if outcome_of(stride, walk.geometric_step_m) is outcome]
        starts_s, ends_s = (np.array([stride[key] for stride in own]) for key in ("t_start_s", "stamp_s"))
        steps_cm = np.array([100.0 * stride["step_m"] for stride in own])
        look: dict[str, Any] = {"color": OUTCOME_COLOURS[outcome], "label": str(outcome)}
        if own and walk.source is None:
            panel.bar(starts_s, steps_cm, ends_s - starts_s, align="edge", **look)
        elif own:
            panel.add_patch(_boxes(starts_s, ends_s, steps_cm, **look)).sticky_edges.y.append(0.0)
            panel.autoscale_view()
    panel.axhline(0.0, color=FAINT, linewidth=0.8)
    if np.isfinite(walk.geometric_step_m):
        step_cm = 100.0 * walk.geometric_step_m
        panel.axhline(step_cm, color=INK, linewidth=0.8, linestyle=":", label="$2l\\,\\sin\\alpha$")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(ncols=4, **LEGEND)
