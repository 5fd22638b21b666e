"""Plots forces, coefficients, depth, position and steps of a walk against time, after the paper's figure 8.

The paper shades the muds that the experimenters prepared, and so does the demo, which knows its track.
mud_layout.py says where the names come from. The flippers stand side by side, with the same scales.

Marks of one kind are one artist: an hour has thousands of strides, and an artist of its own takes ten kilobytes.
"""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from control.records import COEFFICIENTS
from experiments.pictures.mud_layout import MudLayout, MudRegion, mud_regions
from experiments.pictures.recorded_walk import Floats, RecordedWalk
from experiments.pictures.stride_choice import Outcome, Stride, geometric_step_m, of_both_flippers, outcome_of
from experiments.pictures.walk_trace import rows_of_curve
from experiments.reports.style import (
    FAINT,
    FLIPPER_COLOURS,
    FORWARD,
    INK,
    MUD_SHADES,
    OUTCOME_COLOURS,
    SURFACE,
    UP,
    save_picture,
    say_empty,
)

WIDTH_IN, PANEL_IN = 10.0, 1.55
TITLE_HEIGHT = 1.3  # above the names of the muds, in heights of a panel
MOST_DASHES = 20  # of noticed muds; more would cover the curves
DASHES: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (2, 2))}
MARKS: dict[str, Any] = {"color": INK, "linestyle": "", "marker": "|", "markersize": 9.0, "markeredgewidth": 0.7}
SHORTEST_S = 0.1  # least length of the time axis
ROOM_FOR_LETTER = 0.018  # of the width of a panel
HEADROOM = 1.6  # top of a panel as a multiple of its largest value; error bars may be cut
HIGHEST = 0.96  # of the top of a panel: a mark that is higher is drawn here
Draw = Callable[[Axes, RecordedWalk], None]
LEGEND: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 0.95),
    "fontsize": "x-small",
    "frameon": False,
    "columnspacing": 1.2,
    "handlelength": 1.5,
}


def plot_walk(walk: RecordedWalk, path: Path, layout: MudLayout | None = None) -> None:
    """Draw a walk into a PNG, SVG or PDF file."""
    save_picture(partial(draw_walk, walk, layout), path)


def draw_walk(walk: RecordedWalk, layout: MudLayout | None = None) -> Figure:
    """Draw a walk, each flipper in a column. `layout` names the muds where it is known."""
    sides, regions = walk.sides, mud_regions(walk, layout)
    moves = np.any(np.isfinite(walk.body_x_m)) and not walk.fixed_base
    of_body: dict[str, Draw] = {"body (m)": _draw_position, "step (cm)": _draw_steps} if moves else {}
    of_flipper: dict[str, Draw] = {
        "force (N)": _draw_forces,
        **{f"${name}$ (N/cm³)": partial(_draw_coefficient, name=name) for name in COEFFICIENTS},
        "depth (cm)": _draw_depth,
    }
    rows = len(of_flipper) + -(-len(of_body) // len(sides))
    figure = Figure(figsize=(WIDTH_IN, PANEL_IN * rows + 0.6))
    axes = figure.subplots(rows, len(sides), sharex=True, squeeze=False)
    for row, (label, draw) in zip(axes, of_flipper.items(), strict=False):
        row[0].set_ylabel(label)
        for panel, side in zip(row, sides, strict=True):
            if panel is not row[0]:
                panel.sharey(row[0])
                panel.tick_params(labelleft=False)
            draw(panel, side)
    for panel, (label, draw_body) in zip(axes[len(of_flipper) :].flatten(), of_body.items(), strict=False):
        panel.set_ylabel(label)
        draw_body(panel, walk)
    for panel in figure.axes:
        _shade(panel, regions, walk.noticed_s)
    for panel, side in zip(axes[0], sides, strict=True):
        panel.set_title(f"{side.flipper} flipper", y=TITLE_HEIGHT, weight="bold")
        _name_muds(panel, regions, float(walk.time_s[-1]))
    axes[0, 0].set_xlim(0.0, max(float(walk.time_s[-1]), SHORTEST_S))
    for panel in axes[-1]:
        panel.set_xlabel("time (s)")
    axes[-1, -1].set_title(walk.title, y=-0.5, loc="right", size=8, color=FAINT)
    figure.align_ylabels()
    return figure


def _shade(panel: Axes, regions: list[MudRegion], noticed_s: list[float]) -> None:
    across: dict[str, Any] = {"transform": panel.get_xaxis_transform()}  # from the bottom to the top
    for number, shade in enumerate(MUD_SHADES):
        own = regions[number :: len(MUD_SHADES)]
        starts_s, ends_s = [region.start_s for region in own], [region.end_s for region in own]
        _draw_boxes(panel, starts_s, ends_s, np.ones(len(own)), color=shade, zorder=0, **across)
    if len(noticed_s) > MOST_DASHES:
        panel.plot(noticed_s, np.ones(len(noticed_s)), **MARKS, **across)
    else:
        panel.vlines(noticed_s, 0.0, 1.0, **DASHES, **across)


def _draw_boxes(panel: Axes, starts: ArrayLike, ends: ArrayLike, heights: Floats, **look: Any) -> None:
    """Draw boxes that stand on zero."""
    gaps = np.full_like(heights, np.nan)
    x, y = np.column_stack([starts, ends, gaps]).ravel(), np.column_stack([heights, heights, gaps]).ravel()
    panel.fill_between(x, 0.0, y, linewidth=0, **look)


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


def _draw_curve(panel: Axes, walk: RecordedWalk, values: Floats, **look: Any) -> None:
    """Draw the rows of a long walk that this curve needs: matplotlib takes a kilobyte for each."""
    rows = slice(None) if walk.source is None else rows_of_curve(walk.time_s, values)
    panel.plot(walk.time_s[rows], values[rows], **look)


def _draw_forces(panel: Axes, walk: RecordedWalk) -> None:
    _draw_curve(panel, walk, walk.force_x_n, color=FORWARD, linewidth=0.8, label="$f_x$ forward")
    _draw_curve(panel, walk, walk.force_z_n, color=UP, linewidth=0.8, label="$f_z$ up")
    panel.legend(ncols=2, **LEGEND)


def _draw_coefficient(panel: Axes, walk: RecordedWalk, name: str) -> None:
    """Draw values as dots, lower bounds as triangles, invalid ones hollow; bars are two standard errors.

    An invalid value may be of any size: above the scale of the valid ones it stands at the upper edge, without a bar.
    """
    colour, top = FLIPPER_COLOURS[walk.flipper], _top_of(walk, name)
    known = [stride for stride in walk.own_strides if np.isfinite(stride[name])]
    for at_least, valid in product((False, True), repeat=2):
        marked = [s for s in known if (bool(s[f"{name}_at_least"]), bool(s[f"{name}_valid"])) == (at_least, valid)]
        stamps_s, values, errors = _columns(marked, "stamp_s", name, f"{name}_std_error")
        look: dict[str, Any] = {"color": colour, "elinewidth": 1.2, "markerfacecolor": colour if valid else "white"}
        look["label"] = ("lower bound" * at_least or "not valid" * (not valid)) * bool(marked)
        bars = np.where(np.isfinite(errors) & (values <= 1e6 * top), 2.0 * errors / 1e6, np.nan)
        shown = np.minimum(values / 1e6, HIGHEST * top)
        panel.errorbar(stamps_s, shown, bars, fmt="^" if at_least else "o", markersize=5, **look)
    panel.set_ylim(0.0, top)
    if not known:
        say_empty(panel, "no estimate")
    if walk.noticed_s:
        look = MARKS if len(walk.noticed_s) > MOST_DASHES else DASHES
        panel.plot([], [], **look, label="another mud noticed")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(ncols=3, **LEGEND)


def _top_of(walk: RecordedWalk, name: str) -> float:
    """Return the top of a coefficient's panels in N/cm³, by the valid values of both flippers if there are any."""
    known = [stride for stride in walk.strides if np.isfinite(stride[name])]
    scaling = [stride for stride in known if stride[f"{name}_valid"]] or known
    largest = max((stride[name] / 1e6 for stride in scaling), default=0.0)
    return HEADROOM * largest if largest > 0.0 else 1.0


def _columns(strides: list[Stride], *names: str) -> list[Floats]:
    return [np.array([stride[name] for stride in strides], dtype=float) for name in names]


def _draw_depth(panel: Axes, walk: RecordedWalk) -> None:
    _draw_curve(panel, walk, 100.0 * walk.depth_m, color=FLIPPER_COLOURS[walk.flipper], linewidth=1.0, label="measured")
    _draw_curve(panel, walk, 100.0 * walk.depth_command_m, color=INK, linewidth=0.8, label="commanded")
    stamps_s, chosen_m = _columns(walk.own_strides, "stamp_s", "chosen_depth_m")
    if np.any(known := np.isfinite(chosen_m)):
        panel.plot(stamps_s[known], 100.0 * chosen_m[known], "v", color=INK, label="chosen for the next stride")
    stuck_s = [stride["stamp_s"] for stride in walk.own_strides if not stride["released"]]
    if stuck_s:
        stuck_cm = 100.0 * np.interp(stuck_s, walk.time_s, walk.depth_m)
        panel.plot(stuck_s, stuck_cm, "x", color=OUTCOME_COLOURS[Outcome.STUCK], markeredgewidth=2.0, label="stuck")
    panel.axhline(0.0, color=SURFACE, linewidth=1.0)
    panel.yaxis.set_inverted(True)
    panel.legend(ncols=4, **LEGEND)


def _draw_position(panel: Axes, walk: RecordedWalk) -> None:
    _draw_curve(panel, walk, walk.body_x_m, color=INK, linewidth=1.2)


def _draw_steps(panel: Axes, walk: RecordedWalk) -> None:
    """Draw a bar from the start of each stride to its end, in the colour of its outcome."""
    known = of_both_flippers(walk, [stride for stride in walk.own_strides if np.isfinite(stride["step_m"])])
    for outcome in Outcome:
        own = [stride for stride in known if outcome_of(walk, stride) is outcome]
        starts_s, ends_s, steps_m = _columns(own, "t_start_s", "stamp_s", "step_m")
        if own:
            colour = OUTCOME_COLOURS[outcome]
            _draw_boxes(panel, starts_s, ends_s, 100.0 * steps_m, color=colour, label=str(outcome))
    panel.axhline(0.0, color=FAINT, linewidth=0.8)
    full_m = [each for stride in known if np.isfinite(each := geometric_step_m(walk, stride))]
    if full_m:
        step_cm = 100.0 * np.median(full_m)
        panel.axhline(step_cm, color=INK, linewidth=0.8, linestyle=":", label="$2l\\,\\sin\\alpha$")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(ncols=4, **LEGEND)
