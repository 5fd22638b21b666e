"""Plots forces, coefficients, depth, position and steps of a walk against time, after the paper's figure 8.

The paper shades the muds that the experimenters prepared, and so does the demo, which knows its track. A log alone does
not name the muds: there a mud begins with the stride after which the robot noticed it.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from control.records import FLIPPERS as FLIPPER_NAMES
from experiments.pictures.colours import FAINT, FLIPPER_COLOURS, FORWARD, INK, MUD_SHADES, OUTCOME_COLOURS, SURFACE, UP
from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.stride_choice import Outcome, outcome_of
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_names import mud_label
from simulation.mud.track import Track

WIDTH_IN, PANEL_IN, DOTS_PER_INCH = 10.0, 1.55, 120
NOTICED_DASHES = (0, (2, 2))
SHORTEST_S = 0.1  # least length of the time axis
HEADROOM = 1.6  # top of a panel as a multiple of its largest value; error bars may be cut
LEGEND: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.97), "fontsize": "small", "frameon": False}
STYLE: dict[Any, Any] = {
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
}
MudRegion = tuple[float, float, str]  # start and end in s, and the mud's name
Draw = Callable[[Axes, RecordedWalk], None]


def plot_walk(walk: RecordedWalk, path: Path, track: Track | None = None) -> None:
    """Draw a walk into a PNG file. `track` holds the true muds where they are known."""
    wanted, regions = _panels(walk), mud_regions(walk, track)
    size = (WIDTH_IN, PANEL_IN * len(wanted) + 0.4)
    with rc_context(STYLE):
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(len(wanted), 1, sharex=True, squeeze=False)[:, 0]
        for panel, (label, draw) in zip(panels, wanted, strict=True):
            draw(panel, walk)
            panel.set_ylabel(label)
            _shade(panel, regions, walk.noticed_s)
        _name_muds(panels[0], regions)
        panels[0].set_xlim(0.0, max(float(walk.time_s[-1]), SHORTEST_S))
        panels[-1].set_xlabel("time (s)")
        panels[-1].set_title(f"{walk.flipper} flipper, {walk.title}", y=-0.42, loc="right", size=8, color=FAINT)
        figure.align_ylabels()
        figure.savefig(path, dpi=DOTS_PER_INCH)


def _panels(walk: RecordedWalk) -> list[tuple[str, Draw]]:
    """Return the panels for which the log has values."""
    panels: list[tuple[str, Draw]] = [("force (N)", _plot_forces)]
    panels += [(f"${name}$ (N/cm³)", partial(_plot_coefficient, name=name)) for name in COEFFICIENTS]
    panels.append(("depth (cm)", _plot_depth))
    if np.any(np.isfinite(walk.body_x_m)):
        panels += [("body (m)", _plot_position), ("step (cm)", _plot_steps)]
    return panels


def mud_regions(walk: RecordedWalk, track: Track | None) -> list[MudRegion]:
    """Return the muds along the time axis: by the arrival of the body on the track, or as the robot noticed them."""
    end_s = float(walk.time_s[-1])
    if track is None:
        starts_s = [0.0, *walk.mud_starts_s]
        names = [f"mud {number}" for number in range(1, len(starts_s) + 1)]
    else:
        borders_m = [segment.end_m for segment in track.segments[:-1]]
        starts_s = [0.0, *(_arrival_s(walk, border_m) for border_m in borders_m)]
        names = [mud_label(segment.clay.name) for segment in track.segments]
    return [
        (start_s, until_s, name)
        for start_s, until_s, name in zip(starts_s, [*starts_s[1:], end_s], names, strict=True)
        if start_s < until_s
    ]


def _arrival_s(walk: RecordedWalk, position_m: float) -> float:
    """Return when the body first arrived at a position; the end of the walk where it never did."""
    beyond = np.flatnonzero(walk.body_x_m >= position_m)
    return float(walk.time_s[beyond[0] if len(beyond) else -1])


def _shade(panel: Axes, regions: list[MudRegion], noticed_s: list[float]) -> None:
    for number, (start_s, end_s, _) in enumerate(regions):
        panel.axvspan(start_s, end_s, color=MUD_SHADES[number % len(MUD_SHADES)], linewidth=0, zorder=0)
    for at_s in noticed_s:
        panel.axvline(at_s, color=INK, linewidth=1.0, linestyle=NOTICED_DASHES)


def _name_muds(panel: Axes, regions: list[MudRegion]) -> None:
    """Write the names of the muds above the panel's legend."""
    above: dict[str, Any] = {
        "xycoords": ("data", "axes fraction"),
        "xytext": (0.0, 18.0),
        "textcoords": "offset points",
    }
    for start_s, end_s, name in regions:
        panel.annotate(name, ((start_s + end_s) / 2.0, 1.0), ha="center", weight="bold", annotation_clip=False, **above)


def _plot_forces(panel: Axes, walk: RecordedWalk) -> None:
    panel.plot(walk.time_s, walk.force_x_n, color=FORWARD, linewidth=0.8, label="$f_x$ forward")
    panel.plot(walk.time_s, walk.force_z_n, color=UP, linewidth=0.8, label="$f_z$ up")
    panel.legend(ncols=2, **LEGEND)


def _explain_coefficients(panel: Axes, walk: RecordedWalk) -> None:
    """Explain the marks in the panels of coefficients that occur."""
    for flipper in dict.fromkeys(FLIPPER_NAMES[stride["flipper"]] for stride in walk.strides):
        panel.plot([], [], "o", color=FLIPPER_COLOURS[flipper], label=flipper)
    if any(stride[f"{name}_at_least"] for name in COEFFICIENTS for stride in walk.strides):
        panel.plot([], [], "^", color=FAINT, label="lower bound")
    if any(not stride[f"{name}_valid"] for name in COEFFICIENTS for stride in walk.strides):
        panel.plot([], [], "o", color=FAINT, markerfacecolor="white", label="not valid")
    if walk.noticed_s:
        panel.plot([], [], color=INK, linewidth=1.0, linestyle=NOTICED_DASHES, label="another mud noticed")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(ncols=5, **LEGEND)


def _plot_coefficient(panel: Axes, walk: RecordedWalk, name: str) -> None:
    """Draw values as dots, lower bounds as triangles, invalid ones hollow; bars are two standard errors."""
    known = [stride for stride in walk.strides if np.isfinite(stride[name])]
    for stride in known:
        colour = FLIPPER_COLOURS[FLIPPER_NAMES[stride["flipper"]]]
        panel.errorbar(
            stride["stamp_s"],
            stride[name] / 1e6,
            2.0 * stride[f"{name}_std_error"] / 1e6,
            fmt="^" if stride[f"{name}_at_least"] else "o",
            markersize=5,
            linewidth=1.2,
            color=colour,
            markerfacecolor=colour if stride[f"{name}_valid"] else "white",
            label="_",
        )
    largest = max((stride[name] / 1e6 for stride in known), default=0.0)
    panel.set_ylim(0.0, HEADROOM * largest if largest > 0.0 else 1.0)
    if name == COEFFICIENTS[0]:
        _explain_coefficients(panel, walk)


def _plot_depth(panel: Axes, walk: RecordedWalk) -> None:
    panel.plot(walk.time_s, 100.0 * walk.depth_m, color=FLIPPER_COLOURS[walk.flipper], linewidth=1.0, label="measured")
    panel.plot(walk.time_s, 100.0 * walk.depth_command_m, color=INK, linewidth=0.8, label="commanded")
    chosen_m = {s["stamp_s"]: s["chosen_depth_m"] for s in walk.own_strides if np.isfinite(s["chosen_depth_m"])}
    if chosen_m:
        chosen_cm = [100.0 * depth_m for depth_m in chosen_m.values()]
        panel.plot(list(chosen_m), chosen_cm, "v", color=INK, label="chosen for the next stride")
    stuck_s = [stride["stamp_s"] for stride in walk.own_strides if not stride["released"]]
    if stuck_s:
        stuck_cm = 100.0 * np.interp(stuck_s, walk.time_s, walk.depth_m)
        panel.plot(stuck_s, stuck_cm, "x", color=OUTCOME_COLOURS[Outcome.STUCK], markeredgewidth=2.0, label="stuck")
    panel.axhline(0.0, color=SURFACE, linewidth=1.0)
    panel.invert_yaxis()
    panel.legend(ncols=4, **LEGEND)


def _plot_position(panel: Axes, walk: RecordedWalk) -> None:
    panel.plot(walk.time_s, walk.body_x_m, color=INK, linewidth=1.2)


def _plot_steps(panel: Axes, walk: RecordedWalk) -> None:
    """Draw a bar from the start of each stride to its end, in the colour of its outcome."""
    known = [stride for stride in walk.own_strides if np.isfinite(stride["step_m"])]
    for outcome in Outcome:
        own = [stride for stride in known if outcome_of(stride, walk.geometric_step_m) is outcome]
        starts_s = [stride["t_start_s"] for stride in own]
        lengths_s = [stride["stamp_s"] - stride["t_start_s"] for stride in own]
        steps_cm = [100.0 * stride["step_m"] for stride in own]
        if own:
            panel.bar(starts_s, steps_cm, lengths_s, align="edge", color=OUTCOME_COLOURS[outcome], label=str(outcome))
    panel.axhline(0.0, color=FAINT, linewidth=0.8)
    if np.isfinite(walk.geometric_step_m):
        step_cm = 100.0 * walk.geometric_step_m
        panel.axhline(step_cm, color=INK, linewidth=0.8, linestyle=":", label="$2l\\,\\sin\\alpha$")
    if panel.get_legend_handles_labels()[0]:
        panel.legend(ncols=4, **LEGEND)
