"""Undrained clay: the forces at which one mud gives way, from one strength.

With the undrained strength s_u, a plate of width b and thickness t at depth z yields at

    sideways    s_u b ∫ min(3 + γ z/s_u + J z/b, 9) dz     Matlock (1970), soft clay: γ = 17.5 kN/m³, J = 0.5
    downwards   N_c s_u b t + a s_u 2 (b + t) z            end bearing and adhesion, a = 0.25
    upwards     9 s_u b t + a s_u 2 (b + t) z              suction under the edge, fading in the last centimetre

each times g(v) = (1 + c v^0.4) / (1 + c 0.1^0.4), which is 1 at 0.1 m/s. N_c is Prandtl's 5.14 of a strip at the
surface. (Deep strips have up to 9; with that the stiffest mud below could not be entered to 5 cm by the torque there
is, as the robot of Table I did.) None of this is the k-law that the estimator assumes.

The three strengths, and c, come from a fit of a point model with these laws to the six fixed-depth speeds of the
paper's Table I; the adaptive speeds were not used. In this plant, which has more mechanics than that model, they give
the order of those speeds and both failures, not each number: 9.1, 1.5 and 8.1 cm/s at 3 cm, 7.1, 5.1 and 1.8 at 5 cm,
where the paper has 7.6, 2.1, 7.2 and 6.6, 5.5, 3.0. In firm mud the body leaves the stance at 0.9 m/s and coasts on.
"""

from __future__ import annotations

from typing import NamedTuple

UNIT_WEIGHT_N_M3 = 17.5e3
MATLOCK_J = 0.5
DEEP_FACTOR = 9.0
SURFACE_FACTOR = 3.0
BEARING_FACTOR = 5.14
ADHESION = 0.25
SUCTION_FADE_M = 0.01
RATE_COEFFICIENT = 1.99
RATE_EXPONENT = 0.4
REFERENCE_SPEED_M_S = 0.1


class Plate(NamedTuple):
    """The part of a flipper that enters the mud."""

    width_m: float
    thickness_m: float


class Clay(NamedTuple):
    name: str
    strength_pa: float

    def lateral_n(self, depth_m: float, width_m: float) -> float:
        """Yield force sideways at the reference speed."""
        rise_per_m, deep_m = self._lateral_profile(width_m)
        shallow_m = min(depth_m, deep_m)
        factor_m = SURFACE_FACTOR * shallow_m + rise_per_m * shallow_m * shallow_m / 2.0
        factor_m += DEEP_FACTOR * (depth_m - shallow_m)
        return self.strength_pa * width_m * factor_m

    def lateral_center_m(self, depth_m: float, width_m: float) -> float:
        """Depth of the resultant of the sideways pressure."""
        rise_per_m, deep_m = self._lateral_profile(width_m)
        shallow_m = min(depth_m, deep_m)
        moment_m2 = SURFACE_FACTOR * shallow_m**2 / 2.0 + rise_per_m * shallow_m**3 / 3.0
        moment_m2 += DEEP_FACTOR * (depth_m**2 - shallow_m**2) / 2.0
        return moment_m2 * self.strength_pa * width_m / self.lateral_n(depth_m, width_m)

    def _lateral_profile(self, width_m: float) -> tuple[float, float]:
        """Rise of the bearing factor per metre of depth, and the depth from which it stays at 9."""
        rise_per_m = UNIT_WEIGHT_N_M3 / self.strength_pa + MATLOCK_J / width_m
        return rise_per_m, (DEEP_FACTOR - SURFACE_FACTOR) / rise_per_m

    def insertion_n(self, depth_m: float, plate: Plate) -> float:
        edge_n = BEARING_FACTOR * self.strength_pa * plate.width_m * plate.thickness_m
        return edge_n + self._adhesion_n(depth_m, plate)

    def extraction_n(self, depth_m: float, plate: Plate) -> float:
        edge_n = DEEP_FACTOR * self.strength_pa * plate.width_m * plate.thickness_m
        return edge_n * min(1.0, depth_m / SUCTION_FADE_M) + self._adhesion_n(depth_m, plate)

    def edgewise_n(self, depth_m: float, plate: Plate) -> float:
        """Yield force for motion within the plate's plane but across the insertion: both faces and one side."""
        side_n = DEEP_FACTOR * self.strength_pa * plate.thickness_m * depth_m
        return side_n + self._adhesion_n(depth_m, plate)

    def _adhesion_n(self, depth_m: float, plate: Plate) -> float:
        return ADHESION * self.strength_pa * 2.0 * (plate.width_m + plate.thickness_m) * depth_m


def rate_factor(speed_m_s: float) -> float:
    """g(v): faster is stronger."""
    return float((1.0 + RATE_COEFFICIENT * speed_m_s**RATE_EXPONENT) / _AT_REFERENCE)


_AT_REFERENCE = 1.0 + RATE_COEFFICIENT * REFERENCE_SPEED_M_S**RATE_EXPONENT

# By water content in percent, as in Table I of the paper.
MUDS = {"48.5": Clay("48.5", 2590.0), "53.1": Clay("53.1", 519.0), "45.3": Clay("45.3", 4520.0)}
