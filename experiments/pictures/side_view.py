"""The geometry of one flipper in a side view: x forward along the track, z up from the mud's nominal surface.

In the frame that tilts with adduction, the point u outward, s up and w along the plate's normal from the middle of its
lower edge is at ((l + u) sin α + w cos α, (l + u) cos α - w sin α, s - h). R_x(β) turns it to (x, y, z) about the
intersection of the axes (control/geometry.py), which is at height H above the mud.
"""

from collections.abc import Iterable
from math import cos, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.plate_outline import lower_hull

Point = tuple[float, float]  # x, z in m


class SideView(NamedTuple):
    shoulder: Point  # intersection of the axes
    wrist: Point  # joint of arm and plate
    edge: Point  # the middle of the plate's lower edge
    plate: list[Point]  # its outline, counter-clockwise; without the notches of a plate that has any


def view_from_side(
    geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, body_x_m: float = 0.0
) -> SideView:
    l, h, axis_m = geometry.flipper_length_m, geometry.drop_m, geometry.axis_height_m  # noqa: E741
    sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)

    def project(u_m: float, s_m: float, w_m: float = 0.0) -> Point:
        outward_m = (l + u_m) * ca - w_m * sa
        return body_x_m + (l + u_m) * sa + w_m * ca, axis_m + outward_m * sb + (s_m - h) * cb

    half_m = geometry.plate_thickness_m / 2.0
    corners = [project(u_m, s_m, w_m) for u_m, s_m in geometry.plate.corners for w_m in (-half_m, half_m)]
    return SideView((body_x_m, axis_m), project(0.0, h), project(0.0, 0.0), _convex_hull(corners))


def _convex_hull(points: Iterable[Point]) -> list[Point]:
    """Return the hull counter-clockwise: the lower boundary forward, and the upper one back."""
    known = list(points)
    upper = [(-x_m, -z_m) for x_m, z_m in lower_hull((-x_m, -z_m) for x_m, z_m in known)]
    return list(dict.fromkeys([*lower_hull(known), *upper]))
