"""A rigid rectangular plate in clay, integrated over its surface in three dimensions.

The plate is cut into strips along its height and two columns across the wet part of its lower edge, at its Gauss
points. Every piece below the mud's surface is held as by a spring that slides at its yield force (an anchored
elastic-plastic contact)

    faces         across: N_p(ζ) s_u, both faces together      along: a s_u on each face and narrow side, as a vector
    narrow sides  N_p(ζ) s_u for a body as wide as the plate is thick, half of it on each
    lower edge    down N_c s_u, up 9 s_u with suction fading near the surface

with the strength s_u at its own depth ζ (a strip's is the mean over its height), times the rate factor of the plate's
speed. The laws and their constants are those of the clay. Adhesion does not depend on pressure (undrained), so across
and along are independent. Whatever leans, crosses over or pulls sideways comes out of the sum.

The spring's stiffness is that of slow mud, whatever the speed: only its yield follows the rate. A piece that goes
deeper meets unstrained mud, so its force stays while its stiffness rises; one that comes up loses force with
stiffness. Both make the mud passive: at no moment has it given more work than it was given (test_plate_contact).

How far mud moves before it yields at 0.1 m/s: the authors' logs show a sideways load of a fifth of the yield force
after 3.6 mm of sideways motion in insertion, and a plateau after two to three centimetres with the servo's give
included, so SIDEWAYS_YIELD_M is 15 mm. Along the plate and under its edge it yields within a millimetre or two, as
thin layers do.

At rest loads relax: they fade by up to `relaxation` within half a second, and motion loads the springs again.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple, TypeVar

from simulation.clay import (
    ADHESION,
    BEARING_FACTOR,
    DEEP_FACTOR,
    SUCTION_FADE_M,
    SURFACE_FACTOR,
    Clay,
    lateral_rise_per_m,
    rate_factor,
)

SIDEWAYS_YIELD_M = 0.015
LENGTHWAYS_YIELD_M = 0.001
STRIPS = 7
GAUSS = 0.5 / sqrt(3.0)  # of a width, each side of its middle
RELAXATION_S = 0.2
RESTING_M_S = 0.002
WAKING_M = 0.001


class PlateSize(NamedTuple):
    width_m: float
    height_m: float
    thickness_m: float


class Attitude(NamedTuple):
    """How deep the plate is: the middle of its lower edge, and how depth changes outward and (as a loss) upward."""

    depth_m: float
    per_outward: float
    per_upward: float


def lowest_point_m(attitude: Attitude, width_m: float) -> float:
    """Depth of the lower edge's lower corner."""
    return attitude.depth_m + abs(attitude.per_outward) * width_m / 2.0


def wet_edge_m(attitude: Attitude, width_m: float) -> tuple[float, float]:
    """Width of the submerged part of the lower edge, which the waterline cuts, and how far outward its middle is."""
    half_m = width_m / 2.0
    if attitude.depth_m >= abs(attitude.per_outward) * half_m:
        return width_m, 0.0
    waterline_m = -attitude.depth_m / attitude.per_outward
    if attitude.per_outward > 0.0:
        return half_m - waterline_m, (half_m + waterline_m) / 2.0
    return half_m + waterline_m, (waterline_m - half_m) / 2.0


class Twist(NamedTuple):
    """Velocity of the middle of the lower edge along the plate's directions, and how it changes over the plate.

    normal n, outward r along the lower edge, upward s along the plate's height.
    """

    normal_m_s: float = 0.0
    outward_m_s: float = 0.0
    upward_m_s: float = 0.0
    normal_per_outward_s: float = 0.0
    normal_per_upward_s: float = 0.0
    outward_per_upward_s: float = 0.0
    upward_per_outward_s: float = 0.0


class Wrench(NamedTuple):
    """Force of the mud on the plate and its moments: `normal_outward_nm` is the sum of normal force times the way
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


class Instant(NamedTuple):
    """One step of a plate in mud. `grip`: by how much its speed raises the yield."""

    dt_s: float
    clay: Clay
    grip: float
    attitude: Attitude
    twist: Twist


# The submerged part of one strip of a column, a bare tuple since there are twenty in each step:
# the height of its middle above the lower edge, the depth of that, how much of the strip is covered,
# and the mud's strength there.
Strip = tuple[float, float, float, float]

Share = TypeVar("Share", float, complex)


def kept(share: Share, before_n: float, now_n: float) -> Share:
    """What is left of a strain when the yield force, and with it the stiffness, has changed.

    Mud that comes anew is not strained: the force stays. Mud that goes takes its force along: the strain stays.
    """
    return share if now_n <= before_n else share * (before_n / now_n)


def submerged_strips(submerged_m: float, strip_m: float, per_upward: float, clay: Clay) -> list[Strip]:
    """Of a column that is in the mud up to `submerged_m` above the lower edge."""
    strips, strength_pa, layers = [], clay.strength_pa, clay.layers
    for strip in range(STRIPS):
        low_m = strip * strip_m
        covered_m = submerged_m - low_m
        if covered_m <= 0.0:
            break
        if covered_m > strip_m:
            covered_m = strip_m
        middle_m = low_m + covered_m / 2.0
        depth_m = (submerged_m - middle_m) * per_upward
        if layers:
            half_m = covered_m * per_upward / 2.0
            strength_pa = clay.mean_strength_pa(depth_m - half_m, depth_m + half_m)
        strips.append((middle_m, depth_m, covered_m, strength_pa))
    return strips


class PressedColumn:
    """Owns how far the mud is strained that a column of strips is pressed into, as shares of the slow yield."""

    def __init__(self, profile_width_m: float, yield_m: float) -> None:
        """`profile_width_m`: of the whole body, for the pressure law."""
        self.profile_width_m = profile_width_m
        self.yield_m = yield_m
        self.reset()

    def reset(self) -> None:
        self._shares = [0.0] * STRIPS
        self._limits_n = [0.0] * STRIPS

    def fade(self, left: float) -> None:
        self._shares = [share * left for share in self._shares]

    def step(
        self, instant: Instant, strips: list[Strip], breadth_m: float, speed_m_s: float, per_upward_s: float
    ) -> tuple[float, float]:
        """Force against a motion that grows by `per_upward_s` upward, and its moment."""
        clay, grip, layered = instant.clay, instant.grip, bool(instant.clay.layers)
        rise_per_m = lateral_rise_per_m(clay.strength_pa, self.profile_width_m)
        pressed_n_m, per_yield = clay.strength_pa * breadth_m, instant.dt_s / self.yield_m
        moved, per_m = per_yield * speed_m_s, per_yield * per_upward_s
        shares, limits_n = self._shares, self._limits_n
        force_n = moment_nm = 0.0
        for place, (above_edge_m, depth_m, covered_m, strength_pa) in enumerate(strips):
            if layered:
                rise_per_m = lateral_rise_per_m(strength_pa, self.profile_width_m)
                pressed_n_m = strength_pa * breadth_m
            factor = SURFACE_FACTOR + rise_per_m * depth_m
            limit_n = (factor if factor < DEEP_FACTOR else DEEP_FACTOR) * pressed_n_m * covered_m
            share = kept(shares[place], limits_n[place], limit_n) - moved - per_m * above_edge_m
            shares[place] = share = -grip if share < -grip else grip if share > grip else share
            limits_n[place] = limit_n
            force_n += share * limit_n
            moment_nm += share * limit_n * above_edge_m
        limits_n[len(strips) :] = [0.0] * (STRIPS - len(strips))
        return force_n, moment_nm


class RubbedColumn:
    """Owns the same of the mud that sticks to a column: a vector in the plate's plane, outward + i upward."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._shares = [0j] * STRIPS
        self._limits_n = [0.0] * STRIPS

    def fade(self, left: float) -> None:
        self._shares = [share * left for share in self._shares]

    def step(
        self, instant: Instant, strips: list[Strip], breadth_m: float, velocity_m_s: complex, per_upward_s: float
    ) -> tuple[complex, float]:
        """Force against a motion whose outward part grows by `per_upward_s` upward, and that part's moment.

        `breadth_m`: of all surfaces that mud sticks to.
        """
        clay, grip, layered = instant.clay, instant.grip, bool(instant.clay.layers)
        sticking_n_m, per_yield = ADHESION * clay.strength_pa * breadth_m, instant.dt_s / LENGTHWAYS_YIELD_M
        moved, per_m = per_yield * velocity_m_s, per_yield * per_upward_s
        shares, limits_n = self._shares, self._limits_n
        force_n, moment_nm = 0j, 0.0
        for place, (above_edge_m, _, covered_m, strength_pa) in enumerate(strips):
            if layered:
                sticking_n_m = ADHESION * strength_pa * breadth_m
            limit_n = sticking_n_m * covered_m
            share = kept(shares[place], limits_n[place], limit_n) - moved - per_m * above_edge_m
            stretch = abs(share)
            shares[place] = share = share if stretch <= grip else share * (grip / stretch)
            limits_n[place] = limit_n
            force_n += share * limit_n
            moment_nm += share.real * limit_n * above_edge_m
        limits_n[len(strips) :] = [0.0] * (STRIPS - len(strips))
        return force_n, moment_nm


class LowerEdge:
    """Owns how far the mud is strained under the two halves of the lower edge, as shares of the slow bearing force."""

    def __init__(self, thickness_m: float) -> None:
        self.thickness_m = thickness_m
        self.reset()

    def reset(self) -> None:
        self._shares = [0.0, 0.0]
        self._limits_n = [0.0, 0.0]

    def fade(self, left: float) -> None:
        self._shares = [share * left for share in self._shares]

    def step(self, instant: Instant, places_m: tuple[float, float], wet_m: float) -> tuple[float, float]:
        """Force upward, and its moment outward."""
        clay, attitude, twist = instant.clay, instant.attitude, instant.twist
        force_n = moment_nm = 0.0
        for half, outward_m in enumerate(places_m):
            depth_m = attitude.depth_m + attitude.per_outward * outward_m
            suction = DEEP_FACTOR / BEARING_FACTOR * min(depth_m / SUCTION_FADE_M, 1.0)
            moved_m = instant.dt_s * (twist.upward_m_s + twist.upward_per_outward_s * outward_m)
            strength_pa = clay.strength_at_pa(depth_m) if clay.layers else clay.strength_pa
            limit_n = BEARING_FACTOR * strength_pa * self.thickness_m * wet_m / 2.0
            share = kept(self._shares[half], self._limits_n[half], limit_n) - moved_m / LENGTHWAYS_YIELD_M
            self._shares[half] = share = min(max(share, -suction * instant.grip), instant.grip)
            self._limits_n[half] = limit_n
            force_n += share * limit_n
            moment_nm += share * limit_n * outward_m
        return force_n, moment_nm


class Column(NamedTuple):
    """Half of the plate: both faces, and a narrow side."""

    pressed: PressedColumn
    rubbed: RubbedColumn


class PlateContact:
    """Owns the contact of one plate, and for how long it has been at rest."""

    def __init__(self, size: PlateSize, relaxation: float = 0.0) -> None:
        self.size = size
        self.relaxation = relaxation
        self._strip_m = size.height_m / STRIPS
        self._inner, self._outer = (
            Column(PressedColumn(size.width_m, SIDEWAYS_YIELD_M), RubbedColumn()) for _ in range(2)
        )
        self._inner_side, self._outer_side = (PressedColumn(size.thickness_m, LENGTHWAYS_YIELD_M) for _ in range(2))
        self._edge = LowerEdge(size.thickness_m)
        self._parts = (*self._inner, *self._outer, self._inner_side, self._outer_side, self._edge)
        self.reset()

    def reset(self) -> None:
        for part in self._parts:
            part.reset()
        self._rested = 0.0
        self._touched = False

    def leaves(self, attitude: Attitude) -> bool:
        """Whether the plate is clear of the mud, which then forgets it."""
        if lowest_point_m(attitude, self.size.width_m) > 0.0:
            return False
        if self._touched:
            self.reset()
        return True

    def step(self, dt_s: float, clay: Clay, attitude: Attitude, twist: Twist) -> Wrench:
        if self.leaves(attitude):
            return NO_WRENCH
        self._touched = True
        speed_m_s = sqrt(twist.normal_m_s**2 + twist.outward_m_s**2 + twist.upward_m_s**2)
        if self.relaxation:
            self._relax(dt_s, speed_m_s)
        instant = Instant(dt_s, clay, rate_factor(speed_m_s), attitude, twist)
        return self._wrench(instant)

    def _wrench(self, instant: Instant) -> Wrench:
        """The sum over all pieces."""
        half_m = self.size.width_m / 2.0
        wet_m, middle_m = wet_edge_m(instant.attitude, self.size.width_m)
        places_m = (middle_m - GAUSS * wet_m, middle_m + GAUSS * wet_m)
        inner = self._step_column(instant, self._inner, places_m[0], wet_m / 2.0)
        outer = self._step_column(instant, self._outer, places_m[1], wet_m / 2.0)
        inner_n, inner_nm = self._step_side(instant, self._inner_side, -half_m)
        outer_n, outer_nm = self._step_side(instant, self._outer_side, half_m)
        edge_n, edge_nm = self._edge.step(instant, places_m, wet_m)
        n, r, s, n_u, n_s, r_s, s_u = [a + b for a, b in zip(inner, outer, strict=True)]
        return Wrench(n, r + inner_n + outer_n, s + edge_n, n_u, n_s, r_s + inner_nm + outer_nm, s_u + edge_nm)

    def _relax(self, dt_s: float, speed_m_s: float) -> None:
        """At rest towards a share of the load; motion forgets the rest, and its way loads the springs again."""
        before = self._rested
        if speed_m_s >= RESTING_M_S:
            self._rested *= exp(-speed_m_s * dt_s / WAKING_M)
            return
        self._rested += (1.0 - before) * (1.0 - exp(-dt_s / RELAXATION_S))
        left = (1.0 - self.relaxation * self._rested) / (1.0 - self.relaxation * before)
        for part in self._parts:
            part.fade(left)

    def _strips(self, instant: Instant, outward_m: float) -> list[Strip]:
        attitude = instant.attitude
        submerged_m = (attitude.depth_m + attitude.per_outward * outward_m) / attitude.per_upward
        return submerged_strips(submerged_m, self._strip_m, attitude.per_upward, instant.clay)

    def _step_column(self, instant: Instant, column: Column, outward_m: float, breadth_m: float) -> Wrench:
        v_n, v_r, v_s, n_u, n_s, r_s, s_u = instant.twist
        strips = self._strips(instant, outward_m)
        normal_n, normal_nm = column.pressed.step(instant, strips, breadth_m, v_n + n_u * outward_m, n_s)
        sticky_m = 2.0 * breadth_m + self.size.thickness_m
        along_n, outward_nm = column.rubbed.step(instant, strips, sticky_m, complex(v_r, v_s + s_u * outward_m), r_s)
        up_n = along_n.imag
        return Wrench(normal_n, along_n.real, up_n, normal_n * outward_m, normal_nm, outward_nm, up_n * outward_m)

    def _step_side(self, instant: Instant, side: PressedColumn, outward_m: float) -> tuple[float, float]:
        """Force outward, and its moment upward."""
        strips, twist = self._strips(instant, outward_m), instant.twist
        breadth_m = self.size.thickness_m / 2.0
        return side.step(instant, strips, breadth_m, twist.outward_m_s, twist.outward_per_upward_s)
