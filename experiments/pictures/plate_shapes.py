"""Draws the picture of the guide to rigs: the paper's rectangle and the plates of examples/plates in mud.

`python -m experiments.pictures.plate_shapes docs/plates.svg`
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

from control.geometry import FlipperGeometry
from experiments.campaign.plate_file import read_corners
from experiments.reports.style import BODY, FAINT, FLIPPER_COLOURS, INK, MUD, SURFACE, save_picture

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "plates"
DEPTH_CM = 3.0


def draw_plates() -> Figure:
    """Draw plates with their arms level and their lowest corners 3 cm deep, seen along their normal."""
    plates = {"rectangle": FlipperGeometry()}
    plates |= {n: FlipperGeometry(plate_corners_m=read_corners(EXAMPLES / f"{n}.csv")) for n in ("trapezoid", "paddle")}
    figure = Figure(figsize=(2.6 * len(plates), 3.4))
    panels = figure.subplots(1, len(plates), sharex=True, sharey=True)
    for panel, (name, geometry) in zip(panels, plates.items(), strict=True):
        arm_cm = 100.0 * geometry.drop_m - DEPTH_CM
        outline = [(100.0 * u_m, 100.0 * s_m - DEPTH_CM) for u_m, s_m in geometry.plate.corners]
        panel.axhspan(-4.5, 0.0, color=MUD, linewidth=0.0)
        panel.axhline(0.0, color=SURFACE, linewidth=1.0)
        panel.plot([-4.5, 0.0], [arm_cm, arm_cm], color=INK, linewidth=5.0, solid_capstyle="butt", zorder=1)
        panel.fill(*zip(*outline, strict=True), facecolor=FLIPPER_COLOURS["left"], edgecolor=INK, zorder=2)
        panel.plot([0.0], [arm_cm], "o", markersize=5.0, color=BODY, markeredgecolor=INK, zorder=3)
        panel.annotate("", (2.6, -DEPTH_CM), (2.6, arm_cm), arrowprops={"arrowstyle": "<->", "color": FAINT})
        panel.text(2.75, (arm_cm - DEPTH_CM) / 2.0, "drop", va="center", rotation=90, fontsize="small", color=FAINT)
        panel.set(title=name, xlabel="outward, cm", xlim=(-4.5, 3.6), ylim=(-4.5, 6.0), aspect="equal")
    panels[0].set_ylabel("above the mud, cm")
    return figure


if __name__ == "__main__":
    save_picture(draw_plates, Path(sys.argv[1]))
