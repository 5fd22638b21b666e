"""A rigid plate in its own directions: its attitude in the mud, its motion, and the mud's force on it.

The directions are the normal n, outward r along the lower edge and upward s along the plate's height; the middle of the
lower edge is the point that everything is counted from.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple


class PlateSize(NamedTuple):
    """The plate's extents; `corners_m` are the outline of one that is no rectangle, (outward, upward) around it."""

    width_m: float
    height_m: float
    thickness_m: float
    corners_m: tuple[tuple[float, float], ...] = ()


class Attitude(NamedTuple):
    """How deep the plate is: the middle of its lower edge, and how depth changes outward, (as a loss) upward and along
    the normal.
    """

    depth_m: float
    per_outward: float
    per_upward: float
    per_normal: float = 0.0  # of an upright plate

    @property
    def up(self) -> tuple[float, float, float]:
        """The world's vertical along the plate's axes."""
        return -self.per_normal, -self.per_outward, self.per_upward

    def depth_at_m(self, outward_m: float, upward_m: float) -> float:
        return self.depth_m + self.per_outward * outward_m - self.per_upward * upward_m

    def below(self, surface_m: float) -> Attitude:
        """Count depth from a surface that lies `surface_m` lower."""
        return Attitude(self.depth_m - surface_m, self.per_outward, self.per_upward, self.per_normal)


def lowest_point_m(attitude: Attitude, size: PlateSize) -> float:
    """Return the depth of the deepest corner."""
    if not size.corners_m:
        return attitude.depth_m + abs(attitude.per_outward) * size.width_m / 2.0
    return attitude.depth_m + max(attitude.per_outward * u - attitude.per_upward * s for u, s in size.corners_m)


class Twist(NamedTuple):
    """Velocity of the middle of the lower edge along the plate's directions, and how it changes over the plate."""

    normal_m_s: float = 0.0
    outward_m_s: float = 0.0
    upward_m_s: float = 0.0
    normal_per_outward_s: float = 0.0
    normal_per_upward_s: float = 0.0
    outward_per_upward_s: float = 0.0
    upward_per_outward_s: float = 0.0


def speed_of_edge_m_s(twist: Twist) -> float:
    return sqrt(twist.normal_m_s**2 + twist.outward_m_s**2 + twist.upward_m_s**2)


class Wrench(NamedTuple):
    """Force of the mud on the plate and its moments: `normal_outward_nm` is the sum of normal force times the distance
    outward from the middle of the lower edge, and so on.
    """

    normal_n: float = 0.0
    outward_n: float = 0.0
    upward_n: float = 0.0
    normal_outward_nm: float = 0.0
    normal_upward_nm: float = 0.0
    outward_upward_nm: float = 0.0
    upward_outward_nm: float = 0.0


NO_WRENCH = Wrench()
