"""Computes the stresses at which undrained clay yields, from its strength.

With the undrained strength s_u, a body of width b yields at the depth ζ under

    pressure across it    N_p s_u, N_p = min(3 + γ ζ/s_u + J ζ/b, 9)    Matlock (1970): γ = 17.5 kN/m³, J = 0.5
    shear along it        a s_u, a = 0.25                               adhesion
    bearing under it      N_c s_u, N_c = 5.14                           Prandtl's strip at the surface
    suction under it      9 s_u                                         fading in the last centimetre

each times g(v) = (1 + c v^0.4) / (1 + c 0.1^0.4), which is 1 at 0.1 m/s. plate_contact.py sums them over a plate.
(Deep strips withstand up to 9; with that, the available torque could not insert the plate 5 cm into the stiffest mud
below, as the robot of Table I did.) None of this is the k-law that the estimator assumes.

c = 0.4: a plate that stops keeps 86 % of its load, where the authors' logs keep 85 to 90 %, and ten times the speed
adds a tenth to the strength at 0.01 m/s, as in clay practice, and a fifth at 0.1 m/s. (So a held insertion in the
simulated 48.5 % mud keeps 84 % after 3 s, and reaches 2.7 N at 3 cm; the authors' logs of the mud that they call 12.5N
show 2.5 to 2.8 N.)

The three strengths are fitted to the six fixed-depth speeds of the paper's Table I, together with the damping of the
body's rail, by experiments/studies/mud_fit.py; the adaptive speeds are not used. Four fitted numbers reproduce six
speeds: such a mud suffices, but others may do so too. 45.3 % comes out hardly firmer than 48.5 %, which its water
content would not suggest: a motor that just fails at 5 cm gives only a lower bound.

A mud may have layers, crusts or weak ones, in which s_u differs: the laws then apply with the strength at the piece's
own depth, and the weight of the mud above it stays the same.
"""

from __future__ import annotations

from itertools import pairwise
from math import exp, log
from typing import NamedTuple

from simulation.mud.layer import Layer

UNIT_WEIGHT_N_M3 = 17.5e3
MATLOCK_J = 0.5
DEEP_FACTOR = 9.0
SURFACE_FACTOR = 3.0
BEARING_FACTOR = 5.14
ADHESION = 0.25
SUCTION_FADE_M = 0.01
RATE_COEFFICIENT = 0.4
RATE_EXPONENT = 0.4
REFERENCE_SPEED_M_S = 0.1


class Clay(NamedTuple):
    name: str
    strength_pa: float
    layers: tuple[Layer, ...] = ()

    def lateral_n(self, depth_m: float, width_m: float) -> float:
        """Return the sideways yield force on an upright plate at the reference speed."""
        if not self.layers:
            return _lateral_n(self.strength_pa, depth_m, width_m)
        borders_m = {border_m for layer in self.layers for border_m in (layer.top_m, layer.bottom_m)}
        force_n = 0.0
        for top_m, bottom_m in pairwise(sorted({0.0, depth_m} | {m for m in borders_m if 0.0 < m < depth_m})):
            strength_pa = self.mean_strength_pa(top_m, bottom_m)
            force_n += _lateral_n(strength_pa, bottom_m, width_m) - _lateral_n(strength_pa, top_m, width_m)
        return force_n

    def scaled(self, factor: float) -> Clay:
        """Return the same mud, stronger or weaker in all its layers."""
        return Clay(self.name, factor * self.strength_pa, self.layers)

    def strength_at_pa(self, depth_m: float) -> float:
        for layer in self.layers:
            if layer.top_m <= depth_m < layer.bottom_m:
                return layer.factor * self.strength_pa
        return self.strength_pa

    def bearing_pa(self, depth_m: float) -> float:
        """Return the pressure under a level area that is pressed down."""
        return BEARING_FACTOR * self.strength_at_pa(depth_m)

    def sticking_pa(self, depth_m: float) -> float:
        """Return the shear along a level area that is dragged, which is that of the clay without its layers."""
        return ADHESION * self.strength_pa

    @staticmethod
    def rate_factor(speed_m_s: float) -> float:
        """Return g(v): faster is stronger."""
        return rate_factor(speed_m_s)

    def mean_strength_pa(self, from_m: float, to_m: float) -> float:
        """Return the mean strength between two depths."""
        fraction = 1.0
        for layer in self.layers:
            top_m = layer.top_m if layer.top_m > from_m else from_m
            bottom_m = layer.bottom_m if layer.bottom_m < to_m else to_m
            if bottom_m > top_m:
                fraction += (layer.factor - 1.0) * (bottom_m - top_m) / (to_m - from_m)
        return fraction * self.strength_pa


def _lateral_n(strength_pa: float, depth_m: float, width_m: float) -> float:
    """Integrate Matlock's law over uniform mud from the surface to `depth_m`."""
    rise_per_m = lateral_rise_per_m(strength_pa, width_m)
    shallow_m = min(depth_m, (DEEP_FACTOR - SURFACE_FACTOR) / rise_per_m)
    factor_m = SURFACE_FACTOR * shallow_m + rise_per_m * shallow_m * shallow_m / 2.0
    factor_m += DEEP_FACTOR * (depth_m - shallow_m)
    return strength_pa * width_m * factor_m


def lateral_rise_per_m(strength_pa: float, width_m: float) -> float:
    """Return the rise of pressure over strength with depth, which is 3 at the surface and at most 9."""
    return UNIT_WEIGHT_N_M3 / strength_pa + MATLOCK_J / width_m


def rate_factor(speed_m_s: float) -> float:
    """Return g(v): faster is stronger."""
    return float((1.0 + RATE_COEFFICIENT * speed_m_s**RATE_EXPONENT) / _AT_REFERENCE)


_AT_REFERENCE = 1.0 + RATE_COEFFICIENT * REFERENCE_SPEED_M_S**RATE_EXPONENT

# By water content in percent, as in Table I of the paper.
MUDS = {"48.5": Clay("48.5", 2800.0), "53.1": Clay("53.1", 684.0), "45.3": Clay("45.3", 3445.0)}
DRIEST_PERCENT, WETTEST_PERCENT = 44.0, 56.0


def clay_of_water(percent: float) -> Clay:
    """Interpolate the strengths of the three muds exponentially, and extrapolate them with the nearest slope.

    Raises ValueError outside of the range that they support.
    """
    if not DRIEST_PERCENT <= percent <= WETTEST_PERCENT:
        raise ValueError(f"{percent:g} % of water: must be {DRIEST_PERCENT:g} to {WETTEST_PERCENT:g}")
    fitted = sorted((float(name), log(clay.strength_pa)) for name, clay in MUDS.items())
    (water, strength), (next_water, next_strength) = fitted[:2] if percent < fitted[1][0] else fitted[1:]
    slope = (next_strength - strength) / (next_water - water)
    return Clay(f"{percent:g}", exp(strength + slope * (percent - water)))
