"""The outline of a flipper's plate: a polygon in the plate's own plane, and its edges for the laws of the coefficients.

A corner is (outward, upward): along the arm from the point that `flipper_length_m` names, and up from the lowest
corner, which hangs `drop_m` below the arm. The mounting angle turns the plate in its plane as it is drawn; then the
lowest corner is put back to that drop. Every polygon is the signed sum of the regions above its edges, which extend
upward without end: counter-clockwise, an edge that runs outward lies below the plate and counts +1, one that runs
inward lies above it and counts -1, and an upright one adds nothing. So the integrals
(plate_integrals.py) are closed forms.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from math import cos, fsum, inf, radians, sin
from typing import NamedTuple

Corner = tuple[float, float]  # outward, upward in m

FEWEST, MOST = 3, 64  # corners: each edge costs a closed form for every batch of a stride
LEAST_M, LARGEST_M = 0.002, 0.5  # extent of a plate, as for a rectangle's width and height
UPRIGHT_M = 1e-9  # extent along the arm of an edge that is upright but for rounding


# An edge that is not upright, a bare tuple because the integrals unpack it in their inner loop: its inner and outer end
# outward, the heights of both, its rise per length outward, and +1.0 below the plate or -1.0 above it.
Edge = tuple[float, float, float, float, float, float]


class PlateOutline(NamedTuple):
    """A mounted plate."""

    corners: tuple[Corner, ...]  # counter-clockwise, seen with outward to the right
    edges: tuple[Edge, ...]
    lower_edges: tuple[Edge, ...]  # all that count where the upper ones are dry
    lowest_top_m: float  # least height of an upper edge
    reach_m: float  # of the farthest corner from the origin, outward or inward
    lower_corners: tuple[Corner, ...]  # those that can be the deepest one of a plate that stands up

    @property
    def width_m(self) -> float:
        """Extent along the arm."""
        outward_m = [corner[0] for corner in self.corners]
        return max(outward_m) - min(outward_m)

    @property
    def height_m(self) -> float:
        return max(corner[1] for corner in self.corners)

    def below_origin_m(self, per_outward: float, per_upward: float) -> float:
        """Return how much deeper than the origin the deepest corner is; depth grows outward and is lost upward."""
        deepest_m = -inf
        for outward_m, upward_m in self.lower_corners:
            depth_m = per_outward * outward_m - per_upward * upward_m
            if depth_m > deepest_m:
                deepest_m = depth_m
        return deepest_m


def rectangle(width_m: float, height_m: float) -> tuple[Corner, ...]:
    half_m = width_m / 2.0
    return (-half_m, 0.0), (half_m, 0.0), (half_m, height_m), (-half_m, height_m)


def mounted_outline(corners: Sequence[Corner], angle_deg: float = 0.0) -> PlateOutline:
    """Return the outline of a plate as drawn; a positive angle moves its lower end outward."""
    around = tuple(corners) if signed_area_m2(corners) >= 0.0 else tuple(reversed(corners))
    if angle_deg:
        turned = [_turned(corner, radians(angle_deg)) for corner in around]
        lowest_m = min(upward_m for _, upward_m in turned)
        around = tuple((outward_m, upward_m - lowest_m) for outward_m, upward_m in turned)
    edges = tuple(_edges(around))
    return PlateOutline(
        corners=around,
        edges=edges,
        lower_edges=tuple(edge for edge in edges if edge[5] > 0.0),
        lowest_top_m=min((min(edge[2:4]) for edge in edges if edge[5] < 0.0), default=0.0),
        reach_m=max((abs(outward_m) for outward_m, _ in around), default=0.0),
        lower_corners=tuple(lower_hull(around)),
    )


def _turned(corner: Corner, angle_rad: float) -> Corner:
    (u, s), sine, cosine = corner, sin(angle_rad), cos(angle_rad)
    return u * cosine - s * sine, u * sine + s * cosine


def _edges(corners: Sequence[Corner]) -> Iterator[Edge]:
    for here, after in zip(corners, [*corners[1:], corners[0]], strict=True):
        inner, outer = min(here, after), max(here, after)
        along_m = outer[0] - inner[0]
        if along_m > UPRIGHT_M:
            slope = (outer[1] - inner[1]) / along_m
            yield inner[0], outer[0], inner[1], outer[1], slope, 1.0 if here < after else -1.0


def lower_hull(corners: Iterable[Corner]) -> list[Corner]:
    """Return the lower boundary of the convex hull of points, outward (Andrew's monotone chain)."""
    hull: list[Corner] = []
    for corner in sorted(corners):
        if hull and hull[-1][0] == corner[0]:
            continue  # above the one before
        while len(hull) > 1 and _turn(hull[-2], hull[-1], corner) <= 0.0:
            hull.pop()
        hull.append(corner)
    return hull


def signed_area_m2(corners: Sequence[Corner]) -> float:
    """Return the area, positive where the corners go counter-clockwise."""
    pairs = zip(corners, [*corners[1:], *corners[:1]], strict=True)
    return fsum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2.0


def _turn(a: Corner, b: Corner, c: Corner) -> float:
    """Return the area of the parallelogram a, b, c: positive where the path turns left at b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])


def outline_problems(corners: Sequence[Corner]) -> Iterator[str]:
    """Yield what is wrong with the corners of a plate, with what to do; corners count from 1."""
    if not FEWEST <= len(corners) <= MOST:
        yield f"has {len(corners)} corners: must have {FEWEST} to {MOST}"
        return
    problems = [*_bound_problems(corners), *_extent_problems(corners)]
    yield from problems or _order_problems(corners)


def _bound_problems(corners: Sequence[Corner]) -> Iterator[str]:
    for number, (outward_m, upward_m) in enumerate(corners, 1):
        if not abs(outward_m) <= LARGEST_M:
            yield f"corner {number}: {outward_m:g} m outward must be from {-LARGEST_M:g} to {LARGEST_M:g}, in m"
        if not 0.0 <= upward_m <= LARGEST_M:
            yield f"corner {number}: {upward_m:g} m upward must be from 0, the lowest corner, to {LARGEST_M:g}, in m"


def _extent_problems(corners: Sequence[Corner]) -> Iterator[str]:
    lowest_m = min(upward_m for _, upward_m in corners)
    if lowest_m > UPRIGHT_M:
        yield f"the lowest corner is {lowest_m:g} m up: count all heights from it, and geometry.drop_m down to it"
    for name, values_m in zip(("wide", "high"), zip(*corners, strict=True), strict=True):
        extent_m = max(values_m) - min(values_m)
        if extent_m < LEAST_M:
            yield f"the plate is {extent_m:g} m {name}: must be at least {LEAST_M:g} m, check the corners"


def _order_problems(corners: Sequence[Corner]) -> Iterator[str]:
    """Yield the first edges that meet outside of a common corner, or that enclose nothing."""
    edges = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    for (one, a), (other, b) in combinations(enumerate(edges, 1), 2):
        is_next = other == one + 1 or (one == 1 and other == len(edges))
        meets = _folds_back(a, b) if is_next and len(set(a + b)) == 3 else _crosses(a, b)
        if meets:
            yield (
                f"the edge from corner {one} to {one % len(edges) + 1} crosses or touches the edge from corner {other}"
                f" to {other % len(edges) + 1}: list each corner once, in order around the plate"
            )
            return


def _folds_back(a: tuple[Corner, Corner], b: tuple[Corner, Corner]) -> bool:
    """Return whether two edges with a common corner lie on each other."""
    (common,) = set(a) & set(b)
    (p, q) = next(end for end in a if end != common), next(end for end in b if end != common)
    ahead = (p[0] - common[0]) * (q[0] - common[0]) + (p[1] - common[1]) * (q[1] - common[1])
    return _turn(common, p, q) == 0.0 and ahead > 0.0


def _crosses(a: tuple[Corner, Corner], b: tuple[Corner, Corner]) -> bool:
    """Return whether two edges have a point in common."""
    turns = [_turn(*a, b[0]), _turn(*a, b[1]), _turn(*b, a[0]), _turn(*b, a[1])]
    if turns[0] * turns[1] < 0.0 and turns[2] * turns[3] < 0.0:
        return True
    points = ((b[0], a), (b[1], a), (a[0], b), (a[1], b))
    return any(turn == 0.0 and _spans(edge, point) for turn, (point, edge) in zip(turns, points, strict=True))


def _spans(edge: tuple[Corner, Corner], point: Corner) -> bool:
    """Return whether a point on an edge's line is between its ends."""
    return all(min(p, q) <= x <= max(p, q) for p, q, x in zip(*edge, point, strict=True))
