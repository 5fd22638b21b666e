"""The geometry of one flipper in a side view: x forward along the track, z up from the mud's nominal surface.

In the frame that tilts with adduction, the point u outward, s up and w along the plate's normal from the middle of its
lower edge is at ((l + u) sin α + w cos α, (l + u) cos α - w sin α, s - h). R_x(β) turns it to (x, y, z) about the
intersection of the axes (control/geometry.py), which is at height H above the mud. The outline of the plate is the
convex hull of its eight corners.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
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

    half_width_m, half_thickness_m = geometry.plate_width_m / 2.0, geometry.plate_thickness_m / 2.0
    corners = product(
        (-half_width_m, half_width_m), (0.0, geometry.plate_height_m), (-half_thickness_m, half_thickness_m)
    )
    outline = convex_hull(project(*corner) for corner in corners)
    return SideView((body_x_m, axis_m), project(0.0, h), project(0.0, 0.0), outline)


def convex_hull(points: Iterable[Point]) -> list[Point]:
    """Return the hull counter-clockwise from the leftmost point: a lower and an upper half that only turn left."""
    ordered = sorted(set(points))
    return _left_turns(ordered)[:-1] + _left_turns(ordered[::-1])[:-1]


def _left_turns(points: list[Point]) -> list[Point]:
    hull: list[Point] = []
    for point in points:
        while len(hull) > 1 and _turn(hull[-2], hull[-1], point) <= 0.0:
            hull.pop()
        hull.append(point)
    return hull


def _turn(a: Point, b: Point, c: Point) -> float:
    """Return a positive value where the path from a over b to c turns left."""
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
