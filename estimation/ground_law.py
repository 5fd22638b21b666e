"""Which law the ground under the flippers follows: that of soft mud or that of dry sand.

Each law says how the three coefficients of one ground compare, whatever its strength. A plate of width w and
thickness t at the depth z has, per unit of strength,

    mud     k_p = (N_c t w + 2 a (w + t) z) / t w z    k_s = 6/z + J/w           k_e = (9 t w + 2 a (w + t) z) / t w z
    sand    k_p = α_down z / 2t                        k_s = α_across            k_e = α_up z / 2t

Mud is undrained clay: bearing under the edge (N_c = 5.14) or suction (9), adhesion on all sides (a = 0.25), and across
the plate Matlock's pressure (1970) from 3 at the surface, with J = 0.5. Sand is resistive-force theory of a plate on
edge (Li, Zhang and Goldman 2013, their generic coefficients): a plate that is drawn up hardly loads it, where mud holds
a plate that leaves it. So the evidence is in k_e. The strength of a law is the mean of two coefficients, and its error
is how wrong it predicts the third one from them.
"""

from collections.abc import Callable, Mapping
from math import exp, fsum, log, sqrt
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.plate_integrals import mean_width_m

BEARING, SUCTION, ADHESION = 5.14, 9.0, 0.25
PRESSURE_AT_SURFACE, MATLOCK_J = 3.0, 0.5
DOWN, ACROSS, UP = 0.128, 0.370, 0.054
LARGEST_ERROR = 0.5  # of a logarithm: real grounds differ from their laws by a quarter to a third
CLEARLY = 2.0  # times the error of the better law
COEFFICIENTS = ("k_p", "k_s", "k_e")
UNDECIDED = "undecided"
Reading = tuple[float, float]  # a coefficient in N/m³, and the depth below the surface in m to which it belongs


class LawEvidence(NamedTuple):
    name: str  # of the law that holds, or UNDECIDED
    errors: Mapping[str, float]  # of each law: the fraction by which it predicts a coefficient wrongly


def _of_mud(coefficient: str, width_m: float, thickness_m: float, depth_m: float) -> float:
    if coefficient == "k_s":
        return 2.0 * PRESSURE_AT_SURFACE / depth_m + MATLOCK_J / width_m
    edge = (BEARING if coefficient == "k_p" else SUCTION) * thickness_m * width_m
    return (edge + 2.0 * ADHESION * (width_m + thickness_m) * depth_m) / (thickness_m * width_m * depth_m)


def _of_sand(coefficient: str, width_m: float, thickness_m: float, depth_m: float) -> float:
    if coefficient == "k_s":
        return ACROSS
    return (DOWN if coefficient == "k_p" else UP) * depth_m / (2.0 * thickness_m)


LAWS: dict[str, Callable[[str, float, float, float], float]] = {"mud": _of_mud, "sand": _of_sand}


def law_evidence(geometry: FlipperGeometry, readings: Mapping[str, Reading]) -> LawEvidence | None:
    """Return which law explains the readings of one ground, by coefficient; None unless there are all three."""
    if not all(name in readings and min(readings[name]) > 0.0 for name in COEFFICIENTS):
        return None
    errors = {}
    for law, value in LAWS.items():
        strengths = []
        for name in COEFFICIENTS:
            k, depth_m = readings[name]
            strengths.append(log(k / value(name, mean_width_m(geometry, depth_m), geometry.plate_thickness_m, depth_m)))
        others = [(fsum(strengths) - each) / 2.0 for each in strengths]
        errors[law] = sqrt(fsum((a - b) ** 2 for a, b in zip(strengths, others, strict=True)) / len(strengths))
    better, worse = sorted(errors, key=errors.__getitem__)[:2]
    holds = errors[better] <= LARGEST_ERROR and errors[worse] >= CLEARLY * errors[better]
    return LawEvidence(better if holds else UNDECIDED, {law: exp(error) - 1.0 for law, error in errors.items()})


def law_of_estimate(geometry: FlipperGeometry, mud_estimate: MudEstimate) -> LawEvidence | None:
    """Return the evidence in what the robot remembers of the ground; a lower bound is none."""
    known = {name: getattr(mud_estimate, name) for name in COEFFICIENTS}
    return law_evidence(
        geometry, {name: (k.value, k.depth_m) for name, k in known.items() if k is not None and not k.at_least}
    )
