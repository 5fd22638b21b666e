"""Draws the path of a gait over the ground from the side: where the plate's lower edge goes, and the plate."""

from typing import Any

from control.gait.stride_table import stride_table
from control.geometry import FlipperGeometry
from control.parameters.gait_path import GaitPath
from experiments.pictures.robot_sketch import draw_view, prepare
from experiments.pictures.side_view import SideView, view_from_side
from experiments.reports.style import FAINT, TRAIL

POINTS = 40  # of each row
COLOURS = {"insertion": "#0072b2", "stance": "#009e73", "extraction": "#d55e00", "swing": FAINT, "pause": TRAIL}


def draw_gait(path: GaitPath, geometry: FlipperGeometry, depth_m: float) -> Any:
    """Return a figure of one stride, with the body where the stride begins."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.0))
    panel = figure.subplots()
    half_m, deepest_m = 1.2 * geometry.flipper_length_m, depth_m + 0.02
    prepare(panel, -half_m, half_m, deepest_m, 0.14)
    seen = set[str]()
    for row in stride_table(path, geometry, depth_m):
        views = [_view(geometry, *row.at(i / POINTS)[:2]) for i in range(POINTS + 1)]
        name = path.phase[row.number].name
        edges = [view.edge for view in views]
        label = name if name not in seen else None
        panel.plot(*zip(*edges, strict=True), color=COLOURS[name], linewidth=2.0, label=label, zorder=5)
        seen.add(name)
    draw_view(panel, _view(geometry, row.sweep_end_rad, row.depth_end_m), "left")
    panel.legend(loc="upper left", frameon=False)
    panel.set_title(f"{path.name}: lower edge of the plate, stride depth {100.0 * depth_m:g} cm")
    return figure


def _view(geometry: FlipperGeometry, sweep_rad: float, depth_m: float) -> SideView:
    return view_from_side(geometry, sweep_rad, geometry.adduction_rad(sweep_rad, depth_m))
