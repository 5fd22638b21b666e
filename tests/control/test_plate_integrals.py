"""The plate's closed forms against a dense grid, exact polygon clipping, and virtual work."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import cos, pi, radians, sin, sqrt
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from control.geometry import FlipperGeometry
from control.plate_integrals import (
    DRY,
    SubmergedPlate,
    cross_coupling,
    growth_exponent,
    mean_width_m,
    moment_width_m,
    stance_moment_m4,
    stroke_moment_m4,
    submerged_part,
    submerged_plate,
)
from tests.control.test_geometry import rotation

AUTHORS = FlipperGeometry()
Array = NDArray[np.float64]

geometries = st.builds(
    FlipperGeometry,
    flipper_length_m=st.floats(0.05, 0.5),
    drop_m=st.floats(0.0, 0.2),
    axis_height_m=st.floats(0.0, 0.2),
    plate_width_m=st.floats(0.005, 0.2),
    plate_thickness_m=st.floats(0.001, 0.02),
    plate_height_m=st.floats(0.005, 0.2),
)
TRAPEZOID = ((-0.0075, 0.0), (0.0075, 0.0), (0.0175, 0.07), (-0.0175, 0.07))
ARROW = ((-0.02, 0.0), (0.0, 0.03), (0.02, 0.0), (0.0, 0.07))  # its lower edge has a notch


@st.composite
def polygons(draw: st.DrawFn) -> tuple[tuple[float, float], ...]:
    """Draw corners around a centre at any radius, so that plates have notches, in either order."""
    corners = draw(st.integers(3, 9))
    turns = sorted(draw(st.lists(st.integers(0, 71), min_size=corners, max_size=corners, unique=True)))
    radii_m = draw(st.lists(st.floats(0.005, 0.05), min_size=corners, max_size=corners))
    points = [(r * cos(pi * turn / 36.0), r * sin(pi * turn / 36.0)) for turn, r in zip(turns, radii_m, strict=True)]
    lowest_m = min(s for _, s in points)
    lifted = tuple((u, s - lowest_m) for u, s in points)
    return lifted if draw(st.booleans()) else lifted[::-1]


shapes = st.builds(
    FlipperGeometry, plate_corners_m=st.one_of(st.just(()), polygons()), plate_angle_deg=st.floats(-45.0, 45.0)
)
sweeps = st.floats(-pi / 3, pi / 3)
adductions = st.floats(-1.2, 1.2)  # the plate stands up: cos β > 0


class Pose(NamedTuple):
    """A pose whose edge's middle is `fraction` of the plate's extent in depth below the surface (above: negative)."""

    geometry: FlipperGeometry
    sweep_rad: float
    adduction_rad: float
    fraction: float

    @property
    def surface_m(self) -> float:
        g, lean = self.geometry, abs(cos(self.sweep_rad) * sin(self.adduction_rad))
        extent_m = g.plate_width_m * lean + g.plate_height_m * cos(self.adduction_rad)
        return g.depth_m(self.sweep_rad, self.adduction_rad) - self.fraction * extent_m

    def plate(self) -> SubmergedPlate:
        return submerged_plate(self.geometry, self.sweep_rad, self.adduction_rad, self.surface_m)


poses = st.builds(Pose, geometries, sweeps, adductions, st.floats(-0.8, 1.5))
AWRY = radians(-40.0)  # so far that the plate's edge is far from level
CORNER = Pose(AUTHORS, 0.3, AWRY, -0.05)
TOP_CORNER_DRY = Pose(AUTHORS, 0.3, AWRY, 0.8)


def attitude(pose: Pose) -> tuple[float, float, float]:
    """Return the depth of the edge's middle and its change outward and upward, by rotation matrices."""
    g, up = pose.geometry, rotation(pose.sweep_rad, pose.adduction_rad)[2]
    depth_m = -up @ [0.0, g.flipper_length_m, -g.drop_m] - g.axis_height_m - pose.surface_m
    return float(depth_m), float(-up[1]), float(up[2])


# exact fractions

Point = tuple[Fraction, Fraction]


def clipped(corners: Sequence[Point], height: Callable[[Point], Fraction]) -> list[Point]:
    """Return the part of a polygon where a linear function is not negative (Sutherland and Hodgman)."""
    kept: list[Point] = []
    for before, here in zip([corners[-1], *corners[:-1]], corners, strict=True):
        a, b = height(before), height(here)
        if (a < 0) != (b < 0):
            fraction = a / (a - b)
            kept.append((before[0] + fraction * (here[0] - before[0]), before[1] + fraction * (here[1] - before[1])))
        if b >= 0:
            kept.append(here)
    return kept


def exact_integrals(
    geometry: FlipperGeometry, depth_m: float, per_outward: float, per_upward: float
) -> tuple[Fraction, ...]:
    """Return the integrals of 1, u, s, ζ, ζu, ζs without rounding: a fan of signed triangles, each with the rule of its
    edges' midpoints, which is exact for quadratics.
    """
    corners = [(Fraction(u), Fraction(s)) for u, s in geometry.plate.corners]

    def zeta(point: Point) -> Fraction:
        return Fraction(depth_m) + Fraction(per_outward) * point[0] - Fraction(per_upward) * point[1]

    polygon = clipped(corners, zeta)
    sums = [Fraction(0)] * 6
    for b, c in zip(polygon[1:], polygon[2:], strict=False):
        a = polygon[0]
        area = ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])) / 2
        for p, q in ((a, b), (b, c), (c, a)):
            u, s = (p[0] + q[0]) / 2, (p[1] + q[1]) / 2
            z = zeta((u, s))
            values = (Fraction(1), u, s, z, z * u, z * s)
            sums = [total + area * value / 3 for total, value in zip(sums, values, strict=True)]
    return tuple(sums)


def rounding_scale(geometry: FlipperGeometry, depth_m: float, per_outward: float, q: float) -> Array:
    """Return the size of the terms of the closed forms, each of which is rounded by a fraction of 1e-16.

    The forms let the plate reach up to the waterline and subtract the part above its top.
    """
    half = max(abs(u) for u, _ in geometry.plate.corners)
    deep = abs(depth_m) + abs(per_outward) * half + geometry.plate.height_m * q
    up, wide = deep / q, 2.0 * half
    return wide * up * np.array([1.0, wide, up, deep, deep * wide, deep * up])


@given(st.one_of(geometries, shapes), st.floats(-0.3, 0.3), st.floats(-0.9, 0.9), st.floats(0.3, 1.0))
@example(FlipperGeometry(plate_corners_m=TRAPEZOID), 0.03, 0.0, 1.0)
@example(FlipperGeometry(plate_corners_m=TRAPEZOID), 0.03, 1.0 / 7.0, 1.0)  # the surface along an edge
@example(FlipperGeometry(plate_corners_m=ARROW), 0.02, 0.2, 0.9)  # cut into two parts
@example(FlipperGeometry(plate_corners_m=ARROW, plate_angle_deg=20.0), 0.05, -0.2, 0.9)
@example(AUTHORS, 0.0, 0.5, 0.8)  # one corner under
@example(AUTHORS, 0.0, -0.5, 0.8)
@example(AUTHORS, 0.2, 0.5, 0.8)  # all under
@example(AUTHORS, 0.0625, 0.5, 0.875)  # one corner out
@example(AUTHORS, 0.03, 0.0, 1.0)  # level
@example(AUTHORS, 0.0, 0.0, 1.0)  # edge on the surface
def test_the_closed_forms_are_exact(
    geometry: FlipperGeometry, depth_m: float, per_outward: float, per_upward: float
) -> None:
    plate = submerged_part(geometry, depth_m, per_outward, per_upward)
    exact = np.array([float(value) for value in exact_integrals(geometry, depth_m, per_outward, per_upward)])
    tolerance = 50.0 * np.finfo(float).eps * rounding_scale(geometry, depth_m, per_outward, per_upward)
    assert np.all(np.abs(np.array(plate) - exact) <= tolerance)


def levers_m(pose: Pose, u: float, s: float) -> Array:
    """Return the torques on sweep and adduction of a unit load across the plate at a point of it, by virtual work."""
    g, moved_rad = pose.geometry, 1e-6 * np.eye(2)
    here_rad, arm_m = np.array([pose.sweep_rad, pose.adduction_rad]), [0.0, g.flipper_length_m + u, s - g.drop_m]
    paths_m = [(rotation(*(here_rad + each)) - rotation(*(here_rad - each))) @ arm_m / 2e-6 for each in moved_rad]
    levers: Array = np.array(paths_m) @ rotation(*here_rad)[:, 0]
    return levers


@given(poses)
@example(CORNER)
@example(TOP_CORNER_DRY)
def test_cross_coupling_is_the_ratio_of_the_torques_of_the_triangles_pressure(pose: Pose) -> None:
    g, plate = pose.geometry, pose.plate()
    *_, load, outward, upward = (float(value) for value in exact_integrals(g, *attitude(pose)))
    middle, by_u, by_s = (levers_m(pose, *point) for point in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    sweep, adduction = load * middle + outward * (by_u - middle) + upward * (by_s - middle)
    ratio = cross_coupling(g, plate, pose.sweep_rad)
    if stance_moment_m4(g, plate) > 0.0:
        assert ratio * sweep == pytest.approx(adduction, rel=1e-6, abs=1e-12)
    else:
        assert ratio == pytest.approx(-sin(pose.sweep_rad) * g.drop_m / g.flipper_length_m)  # of the edge's middle


# moments, units and limits


@given(st.floats(0.001, 0.069), geometries)
def test_an_upright_level_plate_has_the_papers_moments(depth_m: float, geometry: FlipperGeometry) -> None:
    g = FlipperGeometry(geometry.flipper_length_m, geometry.drop_m, 0.0, plate_width_m=geometry.plate_width_m)
    plate = submerged_plate(g, 0.0, 0.0, g.drop_m - depth_m)
    l, b, t = g.flipper_length_m, g.plate_width_m, g.plate_thickness_m  # noqa: E741
    assert stance_moment_m4(g, plate) == pytest.approx(l * b * depth_m**2 / 2.0, rel=1e-12)
    arm_m = sqrt(l * l + (g.drop_m - depth_m / 2.0) ** 2)
    assert stroke_moment_m4(g, plate, 0.0) == pytest.approx(t * b * depth_m * arm_m, rel=1e-12)


@given(geometries, sweeps, adductions, st.floats(0.0, 0.5))
def test_a_plate_above_the_mud_is_dry(
    geometry: FlipperGeometry, sweep: float, adduction: float, clearance_m: float
) -> None:
    lowest_m = geometry.depth_m(sweep, adduction) + abs(cos(sweep) * sin(adduction)) * geometry.plate_width_m / 2.0
    plate = submerged_plate(geometry, sweep, adduction, lowest_m + clearance_m + 1e-9)
    assert plate == DRY
    assert stance_moment_m4(geometry, plate) == stroke_moment_m4(geometry, plate, sweep) == 0.0


# other shapes


def test_the_widths_of_a_triangle_and_of_a_trapezoid_are_those_of_their_areas() -> None:
    triangle = FlipperGeometry(plate_corners_m=((0.0, 0.0), (0.02, 0.06), (-0.02, 0.06)))
    assert mean_width_m(triangle, 0.03) == pytest.approx(0.01)  # half of 2 cm
    assert moment_width_m(triangle, 0.03) == pytest.approx(0.02 / 3.0)  # z³/6 · 2/3 in place of w z²/2
    assert growth_exponent(triangle, 0.03) == pytest.approx(2.0)
    trapezoid = FlipperGeometry(plate_corners_m=TRAPEZOID)
    assert mean_width_m(trapezoid, 0.035) == pytest.approx((0.015 + 0.025) / 2.0)
    assert 1.0 < growth_exponent(trapezoid, 0.035) < 2.0
