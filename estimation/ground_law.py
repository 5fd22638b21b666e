"""Which law the ground under the flippers follows: that of soft mud or that of dry sand.

Each law says how the three coefficients of one ground compare, at any strength. A plate of width w and
thickness t at the depth z has, per unit of strength,

    mud     k_p = (N_c t w + 2 a (w + t) z) / t w z    k_s = 6/z + J/w           k_e = (9 t w + 2 a (w + t) z) / t w z
    sand    k_p = α_down z / 2t, or 1                  k_s = α_across            k_e = α_up z / 2t

Mud is undrained clay: bearing under the edge (N_c = 5.14) or suction (9), adhesion on all sides (a = 0.25), and across
the plate Matlock's pressure (1970) from 3 at the surface, with J = 0.5. Sand is resistive-force theory in two forms: of
a thin plate on edge as a whole (Li, Zhang and Goldman 2013, their generic coefficients), and of each surface that
advances (Agarwal, Goldman and Kamrin 2023), where the lower edge meets what a flat plate does. The second form has no
force along a face, so a plate that rises has that of the first. It hardly loads sand, where mud holds a plate that
leaves it. So the evidence is in k_e. Each coefficient is predicted by the strength that the others have by a law, and
the law's error is how wrong that is, in the form that fits better. (A k_s that is a lower bound, as in firm ground, is
left out.)
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import exp, fsum, log, sqrt
from statistics import median
from typing import Any, NamedTuple

from control.geometry import FlipperGeometry
from control.plate_integrals import mean_width_m
from control.records import COEFFICIENTS, StrideEstimate

BEARING, SUCTION, ADHESION = 5.14, 9.0, 0.25
PRESSURE_AT_SURFACE, MATLOCK_J = 3.0, 0.5
DOWN, ACROSS, UP = 0.128, 0.370, 0.054
EDGE_DOWN, FACE_ACROSS = 1.0, 0.262  # of a surface
LARGEST_ERROR = 0.5  # of a logarithm: real grounds differ from their laws by a quarter to a third
CLEARLY = log(2.0)  # more error of the other law: it is wrong by a further factor of two
UNDECIDED = "undecided"
Reading = tuple[float, float]  # a coefficient in N/m³, and the depth below the surface in m to which it belongs
Law = Callable[[str, float, float, float], float]  # of a coefficient: its value in N/m³ for a unit of strength


class LawEvidence(NamedTuple):
    name: str  # of the law that holds, or UNDECIDED
    errors: Mapping[str, float]  # of each law: the fraction by which it predicts a coefficient wrongly


def _of_mud(coefficient: str, width_m: float, thickness_m: float, depth_m: float) -> float:
    if coefficient == "k_s":
        return 2.0 * PRESSURE_AT_SURFACE / depth_m + MATLOCK_J / width_m
    edge = (BEARING if coefficient == "k_p" else SUCTION) * thickness_m * width_m
    return (edge + 2.0 * ADHESION * (width_m + thickness_m) * depth_m) / (thickness_m * width_m * depth_m)


def _of_sand_as_a_whole(coefficient: str, width_m: float, thickness_m: float, depth_m: float) -> float:
    if coefficient == "k_s":
        return ACROSS
    return (DOWN if coefficient == "k_p" else UP) * depth_m / (2.0 * thickness_m)


def _of_sand_by_surfaces(coefficient: str, width_m: float, thickness_m: float, depth_m: float) -> float:
    if coefficient == "k_e":
        return _of_sand_as_a_whole(coefficient, width_m, thickness_m, depth_m)
    return EDGE_DOWN if coefficient == "k_p" else FACE_ACROSS


LAWS: Mapping[str, Sequence[Law]] = {"mud": [_of_mud], "sand": [_of_sand_as_a_whole, _of_sand_by_surfaces]}


def law_evidence(geometry: FlipperGeometry, readings: Mapping[str, Reading]) -> LawEvidence | None:
    """Return which law explains the readings of one ground, by coefficient; None without k_e and another one."""
    known = {name: reading for name, reading in readings.items() if min(reading) > 0.0}
    if "k_e" not in known or len(known) < 2:
        return None
    errors = {name: min(_error(law, geometry, known) for law in forms) for name, forms in LAWS.items()}
    better, worse = sorted(errors, key=errors.__getitem__)[:2]
    holds = errors[better] <= LARGEST_ERROR and errors[worse] >= errors[better] + CLEARLY
    return LawEvidence(better if holds else UNDECIDED, {law: exp(error) - 1.0 for law, error in errors.items()})


def _error(law: Law, geometry: FlipperGeometry, readings: Mapping[str, Reading]) -> float:
    """Return how wrong a law predicts a coefficient from the others, as the root mean square of the logarithm."""
    strengths = [
        log(k / law(name, mean_width_m(geometry, depth_m), geometry.plate_thickness_m, depth_m))
        for name, (k, depth_m) in readings.items()
    ]
    others = [(fsum(strengths) - each) / (len(strengths) - 1) for each in strengths]
    return sqrt(fsum((a - b) ** 2 for a, b in zip(strengths, others, strict=True)) / len(strengths))


def readings_of(measured: Iterable[tuple[str, Any]]) -> dict[str, Reading]:
    """Return the medians of the strides' coefficients, which are estimates or rows of a table with the same names.

    A k_e that is too small to differ from zero, as in sand, counts with its error, as the most that it may be. A
    coefficient that fewer than half of the strides have is left out: in firm ground, which only bounds k_s, the one
    value is that of a stride that swept into another mud.
    """
    found: dict[str, list[Reading]] = {name: [] for name in COEFFICIENTS}
    for name, each in measured:
        faint = name == "k_e" and not each.valid and each.value + each.std_error > 0.0
        if not each.at_least and each.depth_m > 0.0 and (each.valid or faint):
            found[name].append((each.value + faint * each.std_error, each.depth_m))
    half = max(map(len, found.values())) / 2.0
    return {
        name: (median(k for k, _ in own), median(z for _, z in own))
        for name, own in found.items()
        if len(own) >= max(half, 1.0)
    }


def law_of_strides(geometry: FlipperGeometry, strides: Iterable[StrideEstimate]) -> LawEvidence | None:
    """Return the evidence in the strides of one ground."""
    return law_evidence(geometry, readings_of((name, getattr(each, name)) for each in strides for name in COEFFICIENTS))
