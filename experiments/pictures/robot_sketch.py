"""Draws the robot from the side: body, arm and plate, in mud and air."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle

from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.side_view import SideView, view_from_side
from experiments.reports.style import BODY, FAINT, FLIPPER_COLOURS, INK, MUD, SURFACE, TRAIL

BODY_LENGTH_M, BODY_HEIGHT_M, CORNER_M = 0.13, 0.052, 0.018  # not in any log
EYE_M = 0.0045
VEIL = 0.45  # opacity of the mud over the plate


def prepare(panel: Axes, left_m: float, right_m: float, deepest_m: float, highest_m: float) -> None:
    """Prepare a panel with mud, its surface, and air."""
    panel.set(xlim=(left_m, right_m), ylim=(-deepest_m, highest_m), aspect="equal")
    panel.axis("off")
    panel.add_patch(Rectangle((left_m, -deepest_m), right_m - left_m, deepest_m, color=MUD, linewidth=0))
    panel.plot([left_m, right_m], [0.0, 0.0], color=SURFACE, linewidth=1.4)


def show_scales(panel: Axes) -> None:
    """Label a prepared panel in centimetres, for paths that count from the axles."""
    panel.axis("on")
    panel.set(xlabel="forward of the axles (cm)", ylabel="above the mud (cm)")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(lambda at_m, _: f"{100.0 * at_m:zg}")


def body_position_m(walk: RecordedWalk, row: int) -> float:
    """Return the position of the body, interpolated between known ones; zero without any pose."""
    if np.isfinite(walk.body_x_m[row]):
        return float(walk.body_x_m[row])
    known = np.flatnonzero(np.isfinite(walk.body_x_m))
    return float(np.interp(row, known, walk.body_x_m[known])) if len(known) else 0.0


def view_of(walk: RecordedWalk, row: int, origin_m: float) -> SideView:
    """Return the side view of a row. `origin_m` is where the beginning of the track is drawn."""
    sweep_rad, adduction_rad = float(walk.sweep_angle_rad[row]), float(walk.adduction_angle_rad[row])
    return view_from_side(walk.geometry, sweep_rad, adduction_rad, body_position_m(walk, row) + origin_m)


def draw_robot(panel: Axes, walk: RecordedWalk, rows: range, origin_m: float) -> None:
    """Draw the robot at the last of these rows, and the path of the plate's lower edge over all of them."""
    draw_view(panel, view_of(walk, rows[-1], origin_m), walk.flipper)
    edges = [view_of(walk, row, origin_m).edge for row in rows]
    panel.plot(*zip(*edges, strict=True), color=TRAIL, linewidth=1.3, zorder=4)


def draw_view(panel: Axes, view: SideView, flipper: str) -> None:
    colour = FLIPPER_COLOURS[flipper]
    _draw_body(panel, *view.shoulder)
    panel.add_patch(Polygon(view.plate, facecolor=colour, edgecolor=colour, linewidth=1.0, joinstyle="round"))
    panel.plot(*zip(view.shoulder, view.wrist, strict=True), color=INK, linewidth=3.0, solid_capstyle="round")
    panel.plot(*view.shoulder, "o", color=INK, markersize=6)
    veil = Polygon(view.plate, facecolor=MUD, alpha=VEIL, linewidth=0, zorder=3)
    panel.add_patch(veil)
    (left_m, right_m), (low_m, _) = panel.get_xlim(), panel.get_ylim()
    veil.set_clip_path(Rectangle((left_m, low_m), right_m - left_m, -low_m, transform=panel.transData))


def _draw_body(panel: Axes, x_m: float, z_m: float) -> None:
    """Draw the body around its shoulder, with an eye in front."""
    width_m, height_m = BODY_LENGTH_M - 2.0 * CORNER_M, BODY_HEIGHT_M - 2.0 * CORNER_M  # between corners' centres
    corner = (x_m - width_m / 2.0, z_m - height_m / 2.0)
    look: dict[str, Any] = {"facecolor": BODY, "edgecolor": FAINT, "linewidth": 1.2}
    panel.add_patch(FancyBboxPatch(corner, width_m, height_m, boxstyle=f"round,pad={CORNER_M}", **look))
    eye = (x_m + width_m / 2.0, z_m + height_m / 2.0 + 0.25 * CORNER_M)
    panel.add_patch(Circle(eye, EYE_M, color=INK))
