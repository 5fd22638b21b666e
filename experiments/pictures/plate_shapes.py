"""Draws the outlines of flipper plates next to each other, seen along their normal, with arm, drop and mud.

`python -m experiments.pictures.plate_shapes docs/plates.svg` writes the picture of the guide to rigs: the paper's
rectangle and the plates of examples/plates.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from control.geometry import FlipperGeometry
from control.plate_outline import Corner
from experiments.pictures.colours import BODY, FAINT, FLIPPER_COLOURS, INK, MUD, SURFACE

DEPTH_M, BELOW_M, ABOVE_M = 0.03, 0.045, 0.06  # of the drawn plates, and of the picture
INWARD_M, OUTWARD_M = 0.045, 0.036
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "plates"


def draw_plates(plates: Mapping[str, FlipperGeometry], path: Path) -> None:
    """Draw plates with their arms level and their lowest corners 3 cm deep; cm on both axes."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.6 * len(plates), 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(plates), sharey=True, squeeze=False)[0]
    for panel, (name, geometry) in zip(panels, plates.items(), strict=True):
        _draw_plate(panel, geometry)
        panel.set_title(name, fontsize="medium")
        panel.set_xlabel("outward, cm")
    panels[0].set_ylabel("above the mud, cm")
    with rc_context({"svg.hashsalt": "mudskipper", "svg.fonttype": "none"}):
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def _draw_plate(panel: Any, geometry: FlipperGeometry) -> None:
    def shown(u_m: float, s_m: float) -> tuple[float, float]:
        return 100.0 * u_m, 100.0 * (s_m - DEPTH_M)

    panel.axhspan(-100.0 * BELOW_M, 0.0, color=MUD, linewidth=0.0)
    panel.axhline(0.0, color=SURFACE, linewidth=1.0)
    arm_cm = shown(0.0, geometry.drop_m)[1]
    panel.plot([-100.0 * INWARD_M, 0.0], [arm_cm, arm_cm], color=INK, linewidth=5.0, solid_capstyle="butt", zorder=1)
    outline = [shown(u_m, s_m) for u_m, s_m in geometry.plate.corners]
    panel.fill(*zip(*outline, strict=True), facecolor=FLIPPER_COLOURS["left"], edgecolor=INK, linewidth=1.2, zorder=2)
    panel.plot([0.0], [arm_cm], "o", markersize=5.0, color=BODY, markeredgecolor=INK, zorder=3)
    reach_cm = 100.0 * OUTWARD_M - 1.0
    panel.annotate(
        "", (reach_cm, -100.0 * DEPTH_M), (reach_cm, arm_cm), arrowprops={"arrowstyle": "<->", "color": FAINT}
    )
    middle_cm = (arm_cm - 100.0 * DEPTH_M) / 2.0
    panel.text(reach_cm + 0.15, middle_cm, "drop", va="center", rotation=90, fontsize="small", color=FAINT)
    panel.set_xlim(-100.0 * INWARD_M, 100.0 * OUTWARD_M)
    panel.set_ylim(-100.0 * BELOW_M, 100.0 * ABOVE_M)
    panel.set_aspect("equal")


def corners_of(path: Path) -> tuple[Corner, ...]:
    rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return tuple((float(outward_m), float(upward_m)) for outward_m, upward_m in rows)


if __name__ == "__main__":
    shapes = {
        name: FlipperGeometry(plate_corners_m=corners_of(EXAMPLES / f"{name}.csv")) for name in ("trapezoid", "paddle")
    }
    draw_plates({"rectangle": FlipperGeometry(), **shapes}, Path(sys.argv[1]))
