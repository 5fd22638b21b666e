"""Dry sand by resistive-force theory: what resists a piece of a plate by its tilt and the direction of its motion.

The force on a piece is k ζ dA times a map of two or three angles, with k the stiffness of a flat plate that is pushed
down. Two published maps:

    generic    Li, Zhang, Goldman (2013): in the upright plane of the plate's normal, for a thin plate as a whole.
               Motion out of that plane is taken to meet nothing but LEAST.
    spatial    Agarwal, Goldman, Kamrin (2023): for every surface that advances, with friction. As printed it returns up
               to 0.5 % of k ζ in one direction in a thousand, which LEAST prevents.

Maps here return the resistance, against the motion, in the axes of their arguments.
"""

from __future__ import annotations

from math import acos, asin, atan2, copysign, cos, hypot, pi, sin
from typing import NamedTuple

from simulation.mud.vectors import LEVEL, Vector, added, along, cross, dot, horizontal

LEAST = 0.02  # of the resistance along the motion: the smallest of the generic map is 0.054
FRICTION = 0.4  # of the plate on sand, of the order of plastic's
A00, A10, B11, B01, B_11 = 0.206, 0.169, 0.212, 0.358, 0.055
C11, C01, C_11, D10 = -0.124, 0.253, 0.007, 0.088
FLAT_DOWN = 0.87504  # of the spatial map with the table below
# fmt: off
SPATIAL = (
    (.00212, -.02320, -.20890, -.43083, -.00259, .48872, -.00415, .07204, -.02750, -.08772,
     .01992, -.45961, .40799, -.10107, -.06576, .05664, -.09269, .01892, .01033, .15120),
    (-.06796, -.10941, .04725, -.06914, -.05835, -.65880, -.11985, -.25739, -.26834, .02692,
     -.00736, .63758, .08997, .21069, .04748, .20406, .18589, .04934, .13527, -.33207),
    (-.02634, -.03436, .45256, .00835, .02553, -1.31290, -.05532, .06790, -.16404, .02287,
     .02927, .95406, -.00131, -.11028, .01487, -.02730, .10911, -.04097, .07881, -.27519),
)
# fmt: on


def generic_resistance(normal: Vector, up: Vector, direction: Vector) -> Vector:
    ahead = horizontal(up, normal, direction)
    ahead = along(ahead, copysign(1.0, dot(ahead, direction)))
    forward, rising = dot(ahead, direction), dot(up, direction)
    down = copysign(1.0, -dot(normal, up))  # the face that looks down
    tilt, steep = 2.0 * atan2(down * dot(normal, ahead), -down * dot(normal, up)), atan2(-rising, forward)
    lift = A00 + A10 * cos(tilt) + B11 * sin(tilt + steep) + B01 * sin(steep) + B_11 * sin(steep - tilt)
    drag = C11 * cos(tilt + steep) + C01 * cos(steep) + C_11 * cos(steep - tilt) + D10 * sin(tilt)
    in_plane = hypot(forward, rising)
    return added(along(ahead, in_plane * drag), along(up, -in_plane * lift))


def spatial_resistance(normal: Vector, up: Vector, direction: Vector) -> Vector:
    """`normal`: outward, of a surface that advances; the result is that of one side."""
    if dot(normal, direction) < -LEVEL:
        return 0.0, 0.0, 0.0
    ahead = horizontal(up, direction, normal)
    aside = cross(up, ahead)
    n_r, n_t, n_z = dot(normal, ahead), dot(normal, aside), min(max(dot(normal, up), -1.0), 1.0)
    tilt = (-acos(n_z) if n_z >= 0.0 else pi - acos(n_z)) if n_r >= 0.0 else acos(n_z) - pi * (n_z < 0.0)
    steep = -asin(min(max(dot(direction, up), -1.0), 1.0))
    twist = atan2(n_t * copysign(1.0, n_r), abs(n_r))
    f1, f2, f3 = _cubic(sin(steep), cos(tilt), cos(twist) * cos(steep) * sin(tilt) + sin(steep) * cos(tilt))
    drag, side = f1 * sin(tilt) * cos(twist) + f2 * cos(steep), f1 * sin(tilt) * sin(twist)
    lift = -f1 * cos(tilt) - f2 * sin(steep) - f3
    stress = added(along(ahead, drag), along(aside, side), along(up, lift))
    pressed = dot(stress, normal)
    rubbed = added(stress, along(normal, -pressed))
    slips = min(FRICTION * abs(pressed) / max(hypot(*rubbed), LEVEL), 1.0)
    return along(added(along(normal, pressed), along(rubbed, slips)), -1.0 / FLAT_DOWN)


def _cubic(x: float, y: float, z: float) -> tuple[float, ...]:
    squares = x * x, y * y, z * z, x * y, y * z, z * x
    cubes = x**3, y**3, z**3, x * y * y, y * x * x, y * z * z, z * y * y, z * x * x, x * z * z, x * y * z
    powers = (1.0, x, y, z, *squares, *cubes)
    return tuple(sum(c * power for c, power in zip(row, powers, strict=True)) for row in SPATIAL)


class Sand(NamedTuple):
    name: str
    stiffness_n_m3: float
    spatial: bool = False

    def scaled(self, factor: float) -> Sand:
        return self._replace(stiffness_n_m3=factor * self.stiffness_n_m3)

    def resistance(self, normal: Vector, up: Vector, direction: Vector) -> Vector:
        """Return a fraction of k ζ, at least LEAST along the motion."""
        found = (spatial_resistance if self.spatial else generic_resistance)(normal, up, direction)
        return added(found, along(direction, max(LEAST - dot(found, direction), 0.0)))

    def lateral_n(self, depth_m: float, width_m: float) -> float:
        across = self.resistance((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))[0]
        return across * self.stiffness_n_m3 * width_m * depth_m * depth_m / 2.0

    def bearing_pa(self, depth_m: float) -> float:
        return self.stiffness_n_m3 * depth_m

    def sticking_pa(self, depth_m: float) -> float:
        dragged = generic_resistance((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))[0]
        return dragged * self.stiffness_n_m3 * max(depth_m, 0.0)

    @staticmethod
    def rate_factor(speed_m_s: float) -> float:
        """Slow sand has no rate; ρ v² is 3 % of its shear stress at 0.5 m/s and 3 cm."""
        return 1.0
