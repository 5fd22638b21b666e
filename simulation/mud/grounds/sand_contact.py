"""A plate in dry sand: the sum of its pieces, each of which loads over a short distance and keeps its load at rest.

The map of sand.py says what a steady motion meets, f*(v̂). The load f of a piece, as a fraction of k ∫ζ dA, approaches
that over YIELD_M: it first turns towards f* and then follows the motion,

    f' = |v|/Y ( v̂ (1 - f·v̂ / f*·v̂) - (f - its part along f*) / |f*| )

With the energy Y f²/2 the sand receives |v| times a square at least, because f*·v̂ > 0: it is passive for any map and
path. (A load that just tends to f* is not: sand that lets go more softly than it loads returns work.) Implicit steps
keep that. A piece that goes deeper keeps its force; one that comes up loses it with its stiffness, as in clay.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import hypot

from simulation.mud.ground_contact import GroundContact
from simulation.mud.grounds.sand import Sand
from simulation.mud.plate_panels import Corner
from simulation.mud.rigid_plate import Attitude, PlateSize, Twist, Wrench
from simulation.mud.vectors import Vector, added, along, dot

YIELD_M = 0.003  # of a flat plate pushed down; a stiffer spring would ask for shorter steps
Centre = tuple[float, float, float]  # ∫ζ dA, and where its middle is: outward, upward


def wet_face(corners: Sequence[Corner], attitude: Attitude) -> Centre:
    """Integrate the depth over the submerged part of a polygon, as a fan of triangles."""
    wet: list[tuple[float, float, float]] = []
    points = [(u, s, attitude.depth_at_m(u, s)) for u, s in corners]
    for a, b in pairwise([points[-1], *points]):
        if (a[2] > 0.0) != (b[2] > 0.0):
            cut = a[2] / (a[2] - b[2])
            wet.append((a[0] + cut * (b[0] - a[0]), a[1] + cut * (b[1] - a[1]), 0.0))
        if b[2] > 0.0:
            wet.append(b)
    sums = [0.0, 0.0, 0.0]
    for b, c in pairwise(wet[1:]):
        a, part = wet[0], (b[0] - wet[0][0]) * (c[1] - wet[0][1]) - (c[0] - wet[0][0]) * (b[1] - wet[0][1])
        sums[0] += part * (a[2] + b[2] + c[2]) / 6.0
        for axis in (0, 1):
            mixed = (a[axis] + b[axis] + c[axis]) * (a[2] + b[2] + c[2])
            sums[axis + 1] += part * (mixed + a[axis] * a[2] + b[axis] * b[2] + c[axis] * c[2]) / 24.0
    return (abs(sums[0]), sums[1] / sums[0], sums[2] / sums[0]) if sums[0] else (0.0, 0.0, 0.0)


def wet_rim(ends: Sequence[Corner], thickness_m: float, attitude: Attitude) -> Centre:
    """Integrate the depth over the submerged part of a narrow side."""
    (u_a, s_a), (u_b, s_b) = ends
    a_m, b_m = attitude.depth_at_m(u_a, s_a), attitude.depth_at_m(u_b, s_b)
    if a_m <= 0.0 and b_m <= 0.0:
        return 0.0, 0.0, 0.0
    first, last = 0.0, 1.0
    if a_m * b_m < 0.0:
        cut = a_m / (a_m - b_m)
        first, last = (cut, 1.0) if a_m < 0.0 else (0.0, cut)
    top_m, end_m = max(a_m, 0.0), max(b_m, 0.0)
    middle = first + (last - first) * (top_m + 2.0 * end_m) / (3.0 * (top_m + end_m))
    wet_m2 = thickness_m * (last - first) * hypot(u_b - u_a, s_b - s_a)
    return wet_m2 * (top_m + end_m) / 2.0, u_a + middle * (u_b - u_a), s_a + middle * (s_b - s_a)


class SandPiece:
    """Owns the load of the sand on a face of the plate, or on a narrow side of it."""

    def __init__(self, normal: Vector) -> None:
        self.normal = normal
        self.reset()

    def reset(self) -> None:
        self._load: Vector = (0.0, 0.0, 0.0)
        self._limit_n = 0.0

    def step(self, sand: Sand, up: Vector, path_m: Vector, limit_n: float, two_sided: bool) -> Vector:
        """Return the force on the plate, along its axes, after a path."""
        if limit_n > self._limit_n:
            self._load = along(self._load, self._limit_n / limit_n)
        self._limit_n, distance_m = limit_n, hypot(*path_m)
        if distance_m > 0.0:
            direction, moved = along(path_m, 1.0 / distance_m), distance_m / YIELD_M
            backs = two_sided and dot(self.normal, direction) < 0.0
            steady = sand.resistance(along(self.normal, -1.0) if backs else self.normal, up, direction)
            square = dot(steady, steady)
            turned = along(steady, dot(self._load, steady) / square)
            aside = along(added(self._load, along(turned, -1.0)), 1.0 / (1.0 + moved / square**0.5))
            load = added(turned, aside)
            before = dot(load, direction)
            after = (before + moved) / (1.0 + moved / dot(steady, direction))
            self._load = added(load, along(direction, after - before))
        return along(self._load, -limit_n)


class SandContact(GroundContact):
    """Owns the sand around one plate: on its face, and in three dimensions on its narrow sides too."""

    def __init__(self, size: PlateSize) -> None:
        super().__init__(size)
        half_m = size.width_m / 2.0
        level = ((-half_m, 0.0), (half_m, 0.0), (half_m, size.height_m), (-half_m, size.height_m))
        self._corners = size.corners_m or level
        around = list(pairwise([*self._corners, self._corners[0]]))
        turn = 1.0 if sum(a[0] * b[1] - b[0] * a[1] for a, b in around) > 0.0 else -1.0
        self._face = SandPiece((1.0, 0.0, 0.0))
        self._rims = []
        for a, b in around:
            outward = turn / hypot(b[0] - a[0], b[1] - a[1])
            self._rims.append((SandPiece((0.0, outward * (b[1] - a[1]), outward * (a[0] - b[0]))), (a, b)))

    def reset(self) -> None:
        super().reset()
        for piece in (self._face, *(rim for rim, _ in self._rims)):
            piece.reset()

    def press(self, dt_s: float, ground: Sand, attitude: Attitude, twist: Twist, edge_m: float = 0.0) -> Wrench:
        self._touched = True
        total = [0.0] * len(Wrench._fields)
        for piece, (moment_m3, u, s) in self._pieces(ground, attitude):
            v_n, v_r, v_s, n_u, n_s, r_s, s_u = twist
            path_m = along((v_n + n_u * u + n_s * s, v_r + r_s * s, v_s + s_u * u), dt_s)
            limit_n = ground.stiffness_n_m3 * moment_m3
            n, r, up_n = piece.step(ground, attitude.up, path_m, limit_n, piece is self._face)
            total = [a + b for a, b in zip(total, (n, r, up_n, n * u, n * s, r * s, up_n * u), strict=True)]
        return Wrench(*total)

    def _pieces(self, ground: Sand, attitude: Attitude) -> Iterator[tuple[SandPiece, Centre]]:
        yield self._face, wet_face(self._corners, attitude)
        if ground.spatial:
            for rim, ends in self._rims:
                yield rim, wet_rim(ends, self.size.thickness_m, attitude)
