"""The true coefficients of a stride: its own strokes, repeated by a plate on a virtual load cell.

Insertion and extraction follow the flipper's own arc, with a cell in the joint that does not feel the plate's face
(simulation/test_rig); shear goes sideways at the stance's mean attitude; all to the same depth and at the same speed.
The coefficients are fitted by the laws of control/plate: τ = k Φ for insertion and for the last three quarters of
the way up, and F = k_s ∫ζ dA for shear. The second set is of the paper's plate (section II-E), upright and moved
straight, with F = k V. (A leaning plate that is pushed straight down is neither: its face carries a part of the load,
one lean stands for a growing one, and the cell reads 4 % more k_p at 3 cm, 13 % at 4 cm, 31 % at 5 cm. Along the arc it
is 1 to 6 % more than the upright plate's at each of these depths.)
"""

from math import cos, fsum, isfinite, sin

from control.geometry import FlipperGeometry
from control.plate_integrals import SubmergedPlate, submerged_part
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.test_rig.joint_cell import measure_arc
from simulation.test_rig.load_cell import measure_insertion, measure_shear

PAPER_SPEED_M_S = 0.1  # of its load cell; for a plate that did not slip
SHEAR_PATH_M = 0.08
REVERSAL_FRACTION = 0.25  # of the way up, in which the force of the mud reverses
OTHER_PLATE = (
    "A load cell's plate is upright and goes down straight; a flipper's leans and moves along an arc, and in clay a "
    "coefficient belongs to plate, path, depth and speed. In the simulator's clay at 3 cm the flipper's trials have 8 "
    "to 12 % more true k_p than the paper's plate reads, 3 to 8 % less k_s, and k_e within 2 %. At equal depth and "
    "speed that is 5 to 6 % more k_p and 1 % of the others; the rest is 2 mm of depth and an edge that goes down and "
    "up at 0.14 to 0.16 m/s."
)


Truth = dict[str, float]  # N/m³ by coefficient, without those whose stroke did not happen


def true_coefficients(
    stride: StrideTruth, geometry: FlipperGeometry, relaxation: float, hold_s: float, upright: bool
) -> Truth:
    """Return the coefficients of the plate as the paper's load cell carries it, upright, or as the flipper does."""
    found = {
        "k_p": _stiffness(stride, stride.insertion, 1.0, geometry, relaxation, 0.0, upright),
        "k_s": _shear(stride, geometry, upright),
        "k_e": _stiffness(stride, stride.extraction, -1.0, geometry, relaxation, hold_s, upright),
    }
    return {name: k_n_m3 for name, k_n_m3 in found.items() if k_n_m3 is not None}


def _stiffness(
    stride: StrideTruth,
    stroke: StrokeTruth,
    sign: float,
    geometry: FlipperGeometry,
    relaxation: float,
    hold_s: float,
    upright: bool,
) -> float | None:
    """Return k of F = k V or τ = k Φ in a stroke down (sign 1) or up (sign -1), by least squares from the surface."""
    if not (isfinite(stroke.speed_m_s) and stroke.deepest_m > 0.0):
        return None
    deepest_m, motion = stroke.deepest_m, (stroke.deepest_m, stroke.speed_m_s, relaxation, hold_s)
    fitted_m = deepest_m if sign > 0.0 else (1.0 - REVERSAL_FRACTION) * deepest_m
    rows: list[tuple[float, float]] = []  # V and F, or Φ and τ
    if upright:
        straight = measure_insertion(stride.clay, geometry, 0.0, 0.0, *motion)
        for depth_m, force_n in zip(*(straight.down if sign > 0.0 else straight.up), strict=True):
            if 0.0 < depth_m <= fitted_m:
                rows.append((geometry.plate_thickness_m * _plate(geometry, 0.0, depth_m).area_m2, force_n))
    else:
        arc = measure_arc(stride.clay, geometry, stroke.sweep_rad, stride.surface_m, *motion)
        curve = zip(*(arc.down if sign > 0.0 else arc.up), strict=True)
        rows = [(moment_m4, moment_nm) for depth_m, moment_m4, moment_nm in curve if 0.0 < depth_m <= fitted_m]
    square = fsum(x * x for x, _ in rows)
    return fsum(x * sign * y for x, y in rows) / square if square > 0.0 else None


def _shear(stride: StrideTruth, geometry: FlipperGeometry, upright: bool) -> float | None:
    stroke = stride.stance
    if not stroke.deepest_m > 0.0:
        return None
    speed_m_s = stroke.speed_m_s if isfinite(stroke.speed_m_s) else PAPER_SPEED_M_S
    adduction_rad = 0.0 if upright else stroke.adduction_rad
    force_n = measure_shear(stride.clay, geometry, 0.0, adduction_rad, stroke.mean_depth_m, speed_m_s, SHEAR_PATH_M)
    return force_n / _plate(geometry, adduction_rad, stroke.mean_depth_m).depth_moment_m3


def _plate(geometry: FlipperGeometry, adduction_rad: float, depth_m: float) -> SubmergedPlate:
    """Return the plate perpendicular to its motion."""
    return submerged_part(geometry, depth_m, -sin(adduction_rad), cos(adduction_rad))
