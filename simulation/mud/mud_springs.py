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


# The submerged part of one strip of a column, a bare tuple because each step has twenty of them: the height of its
# middle above the lower edge, the depth of that middle, the submerged height, and the mud's strength there.
Strip = tuple[float, float, float, float]


def submerged_strips(step: PlateStep, outward_m: float, foot_m: float, strip_m: float) -> list[Strip]:
    """Return the strips in the mud of a column whose foot is `outward_m` outward, at the height `foot_m`."""
    clay, (depth_m, per_outward, per_upward, _) = step.clay, step.attitude
    submerged_m = (depth_m + per_outward * outward_m) / per_upward - foot_m
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
        strips.append((foot_m + middle_m, depth_m, covered_m, strength_pa))
    return strips


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


class PressedColumn(Springs):
    """The mud that a column of strips presses on."""

    def __init__(self, profile_width_m: float, yield_m: float) -> None:
        """`profile_width_m`: of the whole body, for the pressure law."""
        super().__init__(STRIPS)
        self.profile_width_m = profile_width_m
        self.yield_m = yield_m

    def step(
        self, step: PlateStep, strips: list[Strip], breadth_m: float, speed_m_s: float, per_upward_s: float
    ) -> tuple[float, float]:
        """Return the force against a motion that grows by `per_upward_s` upward, and its moment."""
        dt_s, clay, rate, _, _ = step
        layered, per_yield = bool(clay.layers), dt_s / self.yield_m
        rise_per_m = lateral_rise_per_m(clay.strength_pa, self.profile_width_m)
        pressed_n_m = clay.strength_pa * breadth_m
        moved, per_m = per_yield * speed_m_s, per_yield * per_upward_s
        fractions, limits_n = self._fractions, self._limits_n
        force_n = moment_nm = 0.0
        for place, (above_edge_m, depth_m, covered_m, strength_pa) in enumerate(strips):
            if layered:
                rise_per_m = lateral_rise_per_m(strength_pa, self.profile_width_m)
                pressed_n_m = strength_pa * breadth_m
            factor = SURFACE_FACTOR + rise_per_m * depth_m
            limit_n = (factor if factor < DEEP_FACTOR else DEEP_FACTOR) * pressed_n_m * covered_m
            fraction, before_n = fractions[place], limits_n[place]
            if limit_n > before_n:
                fraction *= before_n / limit_n
            fraction = fraction - moved - per_m * above_edge_m
            fraction = -rate if fraction < -rate else rate if fraction > rate else fraction
            fractions[place], limits_n[place] = fraction, limit_n
            load_n = fraction * limit_n
            force_n += load_n
            moment_nm += load_n * above_edge_m
        limits_n[len(strips) :] = DRY_N[len(strips) :]
        return force_n, moment_nm


class RubbedColumn(Springs):
    """The mud that sticks to a column: its strain is a vector in the plate's plane, outward + i upward."""

    def __init__(self, yield_m: float) -> None:
        super().__init__(STRIPS)
        self.yield_m = yield_m

    def reset(self) -> None:
        super().reset()
        self._strains = [0j] * STRIPS

    def fade(self, remaining: float) -> None:
        self._strains = [strain * remaining for strain in self._strains]

    def step(
        self, step: PlateStep, strips: list[Strip], breadth_m: float, velocity_m_s: complex, per_upward_s: float
    ) -> tuple[complex, float]:
        """Return the force against a motion whose outward part grows by `per_upward_s` upward, and that part's moment.

        `breadth_m`: of all surfaces that mud sticks to.
        """
        dt_s, clay, rate, _, _ = step
        layered, per_yield = bool(clay.layers), dt_s / self.yield_m
        sticking_n_m = ADHESION * clay.strength_pa * breadth_m
        moved, per_m = per_yield * velocity_m_s, per_yield * per_upward_s
        strains, limits_n = self._strains, self._limits_n
        force_n, moment_nm = 0j, 0.0
        for place, (above_edge_m, _, covered_m, strength_pa) in enumerate(strips):
            if layered:
                sticking_n_m = ADHESION * strength_pa * breadth_m
            limit_n = sticking_n_m * covered_m
            strain, before_n = strains[place], limits_n[place]
            if limit_n > before_n:
                strain *= before_n / limit_n
            strain = strain - moved - per_m * above_edge_m
            stretch = abs(strain)
            if stretch > rate:
                strain *= rate / stretch
            strains[place], limits_n[place] = strain, limit_n
            force_n += strain * limit_n
            moment_nm += strain.real * limit_n * above_edge_m
        limits_n[len(strips) :] = DRY_N[len(strips) :]
        return force_n, moment_nm


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
