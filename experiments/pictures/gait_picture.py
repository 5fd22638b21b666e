"""Draws the path of a gait over the ground from the side: where the plate's lower edge goes, and the plate."""

from typing import Any

from control.gait.stride_table import stride_table
from control.geometry import FlipperGeometry
from control.parameters.gait_path import GaitPath
from experiments.pictures.robot_sketch import draw_view, prepare, show_scales
from experiments.pictures.side_view import SideView, view_from_side
from experiments.reports.style import FAINT, TRAIL

POINTS = 40  # of each row
LOWEST_M, HIGHEST_M, MARGIN_M = -0.02, 0.12, 0.02  # what is always shown, and the room below and above the path
COLOURS = {"insertion": "#0072b2", "stance": "#009e73", "extraction": "#d55e00", "swing": FAINT, "pause": TRAIL}


def draw_gait(path: GaitPath, geometry: FlipperGeometry, depth_m: float) -> Any:
    """Return a figure of one stride, with the body where the stride begins. A pause is a dot."""
    from matplotlib.figure import Figure

    rows = stride_table(path, geometry, depth_m)
    edges = [[_view(geometry, *row.at(i / POINTS)[:2]).edge for i in range(POINTS + 1)] for row in rows]
    heights_m = [LOWEST_M, HIGHEST_M, *(z_m for row in edges for _, z_m in row)]
    figure = Figure(figsize=(7.0, 4.0))
    panel = figure.subplots()
    half_m = 1.2 * geometry.flipper_length_m
    prepare(panel, -half_m, half_m, MARGIN_M - min(heights_m), MARGIN_M + max(heights_m))
    for row, points in zip(rows, edges, strict=True):
        name = path.phase[row.number].name
        label = name if name not in panel.get_legend_handles_labels()[1] else None
        look: dict[str, Any] = {"marker": "o" * (name == "pause"), "color": COLOURS[name], "linewidth": 2.0}
        panel.plot(*zip(*points, strict=True), label=label, zorder=5, **look)
    draw_view(panel, _view(geometry, rows[-1].sweep_end_rad, rows[-1].depth_end_m), "left")
    panel.legend(loc="upper left", frameon=False)
    panel.set_title(f"{path.name}: lower edge of the plate, stride depth {100.0 * depth_m:g} cm")
    show_scales(panel)
    return figure


def _view(geometry: FlipperGeometry, sweep_rad: float, depth_m: float) -> SideView:
    return view_from_side(geometry, sweep_rad, geometry.adduction_rad(sweep_rad, depth_m))
