"""The true coefficients of a stride: its own strokes repeated by a plate on a load cell.

The cell carries the flipper's plate in the stroke's mean attitude, through mud of the same strength, straight down,
sideways and straight up, to the same depth and at the same speed. The coefficients are fitted to what acts along its
motion, by the laws of control/plate.py: F = k V for insertion and for the last three quarters of the way up, and
F = k_s ∫ζ dA for shear. Beside it stands the paper's plate (section II-E), upright and square to its motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, isfinite, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.plate import SubmergedPlate, submerged_part
from control.records import UNKNOWN
from simulation.load_cell import LoadCurve, measure_insertion, measure_shear
from simulation.witness import StrideTruth, StrokeTruth

PAPER_SPEED_M_S = 0.1  # of its load cell; for a plate that did not slip, which has no speed of its own
SHEAR_WAY_M = 0.08
REVERSAL_SHARE = 0.25  # of the way up, in which mud that held the plate up turns to hold it down


class TrueCoefficients(NamedTuple):
    """N/m³; NaN where the stroke did not happen."""

    k_p: float
    k_s: float
    k_e: float


class LoadCellTruth(NamedTuple):
    leaning: TrueCoefficients  # the plate as the flipper carried it
    upright: TrueCoefficients  # as the paper's load cell carried it


def load_cell_truth(stride: StrideTruth, geometry: FlipperGeometry, relaxation: float, hold_s: float) -> LoadCellTruth:
    leaning, upright = (true_coefficients(stride, geometry, relaxation, hold_s, upright) for upright in (False, True))
    return LoadCellTruth(leaning, upright)


def true_coefficients(
    stride: StrideTruth, geometry: FlipperGeometry, relaxation: float, hold_s: float, upright: bool
) -> TrueCoefficients:
    """By one of the two plates."""
    return TrueCoefficients(
        _insertion(stride, geometry, relaxation, upright),
        _shear(stride, geometry, upright),
        _extraction(stride, geometry, relaxation, hold_s, upright),
    )


def _insertion(stride: StrideTruth, geometry: FlipperGeometry, relaxation: float, upright: bool) -> float:
    stroke = stride.insertion
    if not (isfinite(stroke.speed_m_s) and stroke.deepest_m > 0.0):
        return UNKNOWN
    angles = _attitude(stroke, upright)
    curve = measure_insertion(stride.clay, geometry, *angles, stroke.deepest_m, stroke.speed_m_s, relaxation).down
    return _stiffness(curve, 1.0, geometry, angles, stroke.deepest_m)


def _extraction(
    stride: StrideTruth, geometry: FlipperGeometry, relaxation: float, hold_s: float, upright: bool
) -> float:
    stroke = stride.extraction
    if not (isfinite(stroke.speed_m_s) and stroke.deepest_m > 0.0):
        return UNKNOWN
    angles, deepest_m = _attitude(stroke, upright), stroke.deepest_m
    curve = measure_insertion(stride.clay, geometry, *angles, deepest_m, stroke.speed_m_s, relaxation, hold_s).up
    return _stiffness(curve, -1.0, geometry, angles, (1.0 - REVERSAL_SHARE) * deepest_m)


def _shear(stride: StrideTruth, geometry: FlipperGeometry, upright: bool) -> float:
    stroke = stride.stance
    if not stroke.deepest_m > 0.0:
        return UNKNOWN
    speed_m_s = stroke.speed_m_s if isfinite(stroke.speed_m_s) else PAPER_SPEED_M_S
    angles = (0.0, 0.0 if upright else stroke.adduction_rad)
    force_n = measure_shear(stride.clay, geometry, *angles, stroke.mean_depth_m, speed_m_s, SHEAR_WAY_M)
    return force_n / _plate(geometry, angles, stroke.mean_depth_m).depth_moment_m3


def _attitude(stroke: StrokeTruth, upright: bool) -> tuple[float, float]:
    """(sweep, adduction)."""
    return (0.0, 0.0) if upright else (stroke.sweep_rad, stroke.adduction_rad)


def _plate(geometry: FlipperGeometry, angles_rad: tuple[float, float], depth_m: float) -> SubmergedPlate:
    sweep_rad, adduction_rad = angles_rad
    return submerged_part(geometry, depth_m, -cos(sweep_rad) * sin(adduction_rad), cos(adduction_rad))


def _stiffness(
    curve: LoadCurve, sign: float, geometry: FlipperGeometry, angles_rad: tuple[float, float], to_depth_m: float
) -> float:
    """k of F = k V by least squares, over the part between surface and `to_depth_m`."""
    volumes, forces = list[float](), list[float]()
    for depth_m, force_n in zip(curve.depths_m, curve.forces_n, strict=True):
        if 0.0 < depth_m <= to_depth_m:
            volumes.append(geometry.plate_thickness_m * _plate(geometry, angles_rad, depth_m).area_m2)
            forces.append(sign * force_n)
    return _slope(volumes, forces)


def _slope(x: Sequence[float], y: Sequence[float]) -> float:
    square = sum(a * a for a in x)
    return sum(a * b for a, b in zip(x, y, strict=True)) / square if square > 0.0 else UNKNOWN
