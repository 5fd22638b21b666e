"""The true coefficients of a stride: its own strokes, repeated by a plate on a virtual load cell.

Insertion and extraction follow the flipper's own arc, to the same depth and at the same speed, with a cell in the joint
that does not feel the plate's face (simulation/test_rig). Between them that plate moves across its face as far as it
did in the stance, which softens mud with a memory. For shear the plate points straight out, goes down and then
backward, with the lean, at the depth and at the speed that it had in the mean while the mud yielded
(reference_sensor.py).
The coefficients are fitted by the laws of plate_integrals.py: τ = k Φ for insertion and for the last three quarters of
the way up, and F = k_s ∫ζ dA for shear. The second set is of the paper's plate (section II-E), upright and moved
straight, with F = k V. (A leaning plate that is pushed straight down is neither: its face carries a part of the load,
one lean stands for a growing one, and the cell reads 4 % more k_p at 3 cm, 13 % at 4 cm, 31 % at 5 cm. Along the arc it
is 1 to 6 % more than the upright plate's at each of these depths.)
"""

from collections.abc import Iterable, Mapping
from math import cos, fsum, isfinite, sin

from control.geometry import FlipperGeometry
from control.plate_integrals import submerged_part
from firmware_host.configuration.configuration import Configuration
from simulation.body.reference_sensor import StrideTruth, StrokeTruth
from simulation.test_rig.joint_cell import JointCell, measure_stroke
from simulation.test_rig.load_cell import LoadCell, measure_shear

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
FlipperTruths = Mapping[tuple[str, int], Truth]  # by flipper and stride


def true_strides(
    strides: Iterable[StrideTruth], configuration: Configuration, relaxation: float, upright: bool = False
) -> FlipperTruths:
    """Return the coefficients of each stride of a robot in mud with this relaxation."""
    known = configuration.geometry, relaxation, configuration.gait.pause_s, upright
    return {(stride.flipper, stride.index): true_coefficients(stride, *known) for stride in strides}


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
    cell: LoadCell | JointCell = JointCell(stride.ground, geometry, stroke.sweep_rad, stride.surface_m, relaxation)
    if upright:
        cell = LoadCell(stride.ground, geometry, 0.0, 0.0, relaxation)
    deepest_m, speed_m_s = stroke.deepest_m, stroke.speed_m_s
    if sign > 0.0:
        curve = cell.lower(deepest_m, speed_m_s)
    else:
        _, curve = measure_stroke(cell, deepest_m, speed_m_s, hold_s, stride.stance.path_m)
        deepest_m *= 1.0 - REVERSAL_FRACTION
    rows = [row for row in curve if 0.0 < row[0] <= deepest_m]
    square = fsum(law * law for _, law, _ in rows)
    return fsum(law * sign * load for _, law, load in rows) / square if square > 0.0 else None


def _shear(stride: StrideTruth, geometry: FlipperGeometry, upright: bool) -> float | None:
    stroke = stride.stance
    if not stroke.deepest_m > 0.0:
        return None
    speed_m_s = stroke.speed_m_s if isfinite(stroke.speed_m_s) else PAPER_SPEED_M_S
    adduction_rad = 0.0 if upright else stroke.adduction_rad
    force_n = measure_shear(stride.ground, geometry, 0.0, adduction_rad, stroke.mean_depth_m, speed_m_s, SHEAR_PATH_M)
    across = submerged_part(geometry, stroke.mean_depth_m, -sin(adduction_rad), cos(adduction_rad))
    return force_n / across.depth_moment_m3
