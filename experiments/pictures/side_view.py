"""The geometry of one flipper in a side view: x forward along the track, z up from the mud's nominal surface.

In the frame that tilts with adduction, the point u outward, s up and w along the plate's normal from the middle of its
lower edge is at ((l + u) sin α + w cos α, (l + u) cos α - w sin α, s - h). R_x(β) turns it to (x, y, z) about the
intersection of the axes (control/geometry.py), which is at height H above the mud.
"""

from cmath import phase
from collections.abc import Iterable
from itertools import accumulate
from math import cos, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry

Point = tuple[float, float]  # x, z in m


class SideView(NamedTuple):
    shoulder: Point  # intersection of the axes
    wrist: Point  # joint of arm and plate
    edge: Point  # the middle of the plate's lower edge
    plate: list[Point]  # its outline, counter-clockwise


def view_from_side(
    geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, body_x_m: float = 0.0
) -> SideView:
    l, h, axis_m = geometry.flipper_length_m, geometry.drop_m, geometry.axis_height_m  # noqa: E741
    sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)

    def project(u_m: float, s_m: float, w_m: float = 0.0) -> Point:
        outward_m = (l + u_m) * ca - w_m * sa
        return body_x_m + (l + u_m) * sa + w_m * ca, axis_m + outward_m * sb + (s_m - h) * cb

    edge, height_m = project(0.0, 0.0), geometry.plate_height_m
    sizes = ((geometry.plate_width_m, 0.0, 0.0), (0.0, height_m, 0.0), (0.0, 0.0, geometry.plate_thickness_m))
    sides = [complex(*project(*size)) - complex(*edge) for size in sizes]
    outline = _outline_of_box(complex(*project(0.0, height_m / 2.0)), sides)
    return SideView((body_x_m, axis_m), project(0.0, h), edge, outline)


def _outline_of_box(middle: complex, sides: Iterable[complex]) -> list[Point]:
    """Return the outline from its leftmost corner: the sides in the order of their directions, there and back."""
    rightward = sorted((max(side, -side, key=lambda each: (each.real, each.imag)) for side in sides), key=phase)
    steps = [*rightward, *(-side for side in rightward[:-1])]
    corners = accumulate(steps, initial=middle - sum(rightward) / 2.0)
    return [(corner.real, corner.imag) for corner in corners]
