"""The mud around a plate, piece by piece: springs that slide at their yield force, an anchored elastic-plastic contact.

The state of a spring is the fraction of its slow yield force that it carries. Its stiffness is that of slow mud at any
speed; only its yield follows the rate. A piece that goes deeper meets unstrained mud: its force stays while its yield
force and its stiffness rise, so the fraction falls. A piece that comes up loses force with stiffness: the fraction
stays. Both make the mud passive: it never returns more work than it received (tests/simulation/mud).

The yield distances at 0.1 m/s come from the authors' logs. They show a sideways load of a fifth of the yield force
after 3.6 mm of sideways motion in insertion, and a plateau after two to three centimetres with the servo's compliance
included, so SIDEWAYS_YIELD_M is 15 mm. Along the plate and under its edge mud yields within a millimetre or two, as
thin layers do.
"""

from typing import NamedTuple

from simulation.mud.clay import (
    ADHESION,
    BEARING_FACTOR,
    DEEP_FACTOR,
    SUCTION_FADE_M,
    SURFACE_FACTOR,
    Clay,
    lateral_rise_per_m,
)
from simulation.mud.rigid_plate import Attitude, Twist

SIDEWAYS_YIELD_M = 0.015
LENGTHWAYS_YIELD_M = 0.001
STRIPS = 7
DRY_N = [0.0] * STRIPS  # the yield forces of strips above the mud


class PlateStep(NamedTuple):
    """One time step of a plate in mud. `rate`: the factor by which the plate's speed raises the yield."""

    dt_s: float
    clay: Clay
    rate: float
    attitude: Attitude
    twist: Twist


# Bare tuples, because each step has four columns.
Heights = tuple[float, float, float]  # submerged above the foot, of the foot above the lower edge, and of one strip
Pressing = tuple[float, float, float]  # breadth in m, velocity across in m/s, and how it grows upward
Rubbing = tuple[float, complex, float]  # breadth of all surfaces, velocity along, and how its outward part grows upward
ColumnForce = tuple[float, float, complex, float]  # across and its moment, along and the moment of its outward part
NOT_RUBBED: Rubbing = (0.0, 0j, 0.0)


def surface_above_edge_m(attitude: Attitude, outward_m: float) -> float:
    """Return how high above the lower edge the mud's surface meets a column."""
    depth_m, per_outward, per_upward, _ = attitude
    return (depth_m + per_outward * outward_m) / per_upward


class Springs:
    """Owns the strain of some pieces of mud, as fractions of their slow yield forces, and these forces."""

    def __init__(self, pieces: int) -> None:
        self._pieces = pieces
        self.reset()

    def reset(self) -> None:
        self._fractions = [0.0] * self._pieces
        self._limits_n = [0.0] * self._pieces

    def fade(self, remaining: float) -> None:
        self._fractions = [fraction * remaining for fraction in self._fractions]


class Column(Springs):
    """The mud on a column of strips: what it presses on, and what sticks to it.

    The strain of what sticks is a vector in the plate's plane, outward + i upward.
    """

    def __init__(self, profile_width_m: float, across_yield_m: float, along_yield_m: float) -> None:
        """`profile_width_m`: of the whole body, for the pressure law."""
        super().__init__(STRIPS)
        self.profile_width_m = profile_width_m
        self.across_yield_m = across_yield_m
        self.along_yield_m = along_yield_m

    def reset(self) -> None:
        super().reset()
        self._strains = [0j] * STRIPS
        self._sticking_n = [0.0] * STRIPS

    def fade(self, remaining: float) -> None:
        super().fade(remaining)
        self._strains = [strain * remaining for strain in self._strains]

    def step(self, step: PlateStep, heights: Heights, pressing: Pressing, rubbing: Rubbing) -> ColumnForce:
        """Move the column for a step: one loop does everything to a strip, as each step has twenty of them."""
        dt_s, (_, strength_pa, layers), rate, (_, _, per_upward, _), _ = step
        (submerged_m, foot_m, strip_m), (breadth_m, speed_m_s, faster_s) = heights, pressing
        sticky_m, velocity_m_s, outward_faster_s = rubbing
        rise_per_m = lateral_rise_per_m(strength_pa, self.profile_width_m)
        per_yield, per_slip = dt_s / self.across_yield_m, dt_s / self.along_yield_m
        moved, moved_per_m = per_yield * speed_m_s, per_yield * faster_s
        slipped, slipped_per_m = per_slip * velocity_m_s, per_slip * outward_faster_s
        fractions, limits_n, strains, sticking_n = self._fractions, self._limits_n, self._strains, self._sticking_n
        force_n, moment_nm, along_n, outward_nm = 0.0, 0.0, 0j, 0.0
        for strip in range(STRIPS):
            low_m = strip * strip_m
            covered_m = submerged_m - low_m
            if covered_m <= 0.0:
                if limits_n[strip]:
                    limits_n[strip:] = sticking_n[strip:] = DRY_N[strip:]
                break
            covered_m = strip_m if covered_m > strip_m else covered_m
            middle_m = low_m + covered_m / 2.0
            depth_m, above_edge_m = (submerged_m - middle_m) * per_upward, foot_m + middle_m
            if layers:
                strength_pa, rise_per_m = self._in_layers(step.clay, depth_m, covered_m * per_upward / 2.0)
            factor = SURFACE_FACTOR + rise_per_m * depth_m
            limit_n = (factor if factor < DEEP_FACTOR else DEEP_FACTOR) * (strength_pa * breadth_m) * covered_m
            fraction, before_n = fractions[strip], limits_n[strip]
            if limit_n > before_n:
                fraction *= before_n / limit_n
            fraction = fraction - moved - moved_per_m * above_edge_m
            fraction = -rate if fraction < -rate else rate if fraction > rate else fraction
            fractions[strip], limits_n[strip] = fraction, limit_n
            force_n, moment_nm = force_n + fraction * limit_n, moment_nm + fraction * limit_n * above_edge_m
            if not sticky_m:
                continue
            limit_n = ADHESION * strength_pa * sticky_m * covered_m
            strain, before_n = strains[strip], sticking_n[strip]
            if limit_n > before_n:
                strain *= before_n / limit_n
            strain = strain - slipped - slipped_per_m * above_edge_m
            stretch = abs(strain)
            if stretch > rate:
                strain *= rate / stretch
            strains[strip], sticking_n[strip] = strain, limit_n
            along_n, outward_nm = along_n + strain * limit_n, outward_nm + strain.real * limit_n * above_edge_m
        return force_n, moment_nm, along_n, outward_nm

    def _in_layers(self, clay: Clay, depth_m: float, half_m: float) -> tuple[float, float]:
        """Return the mean strength of a strip's layers, and the rise of pressure with depth there."""
        strength_pa = clay.mean_strength_pa(depth_m - half_m, depth_m + half_m)
        return strength_pa, lateral_rise_per_m(strength_pa, self.profile_width_m)


class LowerEdge(Springs):
    """The mud under the two halves of the lower edge, which yields at the bearing force."""

    def __init__(self, thickness_m: float, yield_m: float) -> None:
        super().__init__(2)
        self.thickness_m = thickness_m
        self.yield_m = yield_m

    def step(
        self, step: PlateStep, positions_m: tuple[float, float], depths_m: tuple[float, float], wet_m: float
    ) -> tuple[float, float]:
        """Return the force upward, and its moment outward."""
        dt_s, clay, rate, _, twist = step
        fractions, limits_n = self._fractions, self._limits_n
        force_n = moment_nm = 0.0
        for half in (0, 1):
            outward_m, depth_m = positions_m[half], depths_m[half]
            suction = DEEP_FACTOR / BEARING_FACTOR * (depth_m / SUCTION_FADE_M if depth_m < SUCTION_FADE_M else 1.0)
            moved_m = dt_s * (twist.upward_m_s + twist.upward_per_outward_s * outward_m)
            limit_n = BEARING_FACTOR * clay.strength_at_pa(depth_m) * self.thickness_m * wet_m / 2.0
            fraction, before_n = fractions[half], limits_n[half]
            if limit_n > before_n:
                fraction *= before_n / limit_n
            fraction -= moved_m / self.yield_m
            fraction = -suction * rate if fraction < -suction * rate else rate if fraction > rate else fraction
            fractions[half], limits_n[half] = fraction, limit_n
            force_n += fraction * limit_n
            moment_nm += fraction * limit_n * outward_m
        return force_n, moment_nm
