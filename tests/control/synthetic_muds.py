"""Synthetic muds, strides and estimates for the tests of the choice of depth, and the plate in numpy.

The plate is summed over small pieces here, without the formulas of plate_integrals.py.
"""

from collections.abc import Sequence
from math import nan

import numpy as np

from control.computing.bounded_work import finish
from control.depth.depth_choice import DepthAdaptation, DepthChoice
from control.depth.paper_choice import PaperAdaptation
from control.geometry import FlipperGeometry
from control.mud_estimate import Coefficient, FlipperEstimate, MudEstimate
from control.parameters.adaptation_parameters import AdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.records import FLIPPERS, Estimate, StrideEstimate

GEOMETRY, GAIT, PARAMETERS = FlipperGeometry(), GaitParameters(), AdaptationParameters()
MOTOR_FORCE_N, LIFTING_NM = 6.25, 0.75
NOT_REPORTED = Estimate(nan, nan, 0, False, "fewer than 5 samples in the mud")


def reported(
    value: float,
    uncertainty: float = 0.0,
    depth_m: float = 0.03,
    exponent: float = 0.0,
    exponent_uncertainty: float = 0.0,
) -> Coefficient:
    """Return a coefficient of the paper's own law (one k at every depth), unless an exponent is given."""
    return Coefficient(
        value=value,
        std_error=uncertainty,
        repeatability=uncertainty,
        depth_m=depth_m,
        exponent=exponent,
        exponent_std_error=exponent_uncertainty,
        strides=8,
    )


def choose_now(
    adaptation: DepthAdaptation | PaperAdaptation,
    mud_estimate: MudEstimate,
    strides: Sequence[StrideEstimate],
    walked_m: float | None = None,
) -> DepthChoice:
    """Run all units of a choice at once, after a stride at `walked_m` or at the depth of the choice before."""
    return finish(adaptation.choose(mud_estimate, strides, adaptation.choice.depth_m if walked_m is None else walked_m))


def bound(value: float, depth_m: float = 0.03) -> Coefficient:
    return reported(value, depth_m=depth_m)._replace(at_least=True)


def measured(value: float, relative: float = 0.0, at_least: bool = False) -> Estimate:
    """Return the estimate of a stride, with its relative standard error."""
    reason = "the mud held" if at_least else ""
    return Estimate(value, relative * value, 20, True, reason, at_least, relative * value)


def estimated(k_s: Coefficient | None, k_e: Coefficient | None = None, k_p: Coefficient | None = None) -> MudEstimate:
    """Return the same estimate for both flippers."""
    flipper = FlipperEstimate(k_p, k_s, k_e)
    return MudEstimate(k_p, k_s, k_e, flipper, flipper)


def apart(left: FlipperEstimate, right: FlipperEstimate) -> MudEstimate:
    """Return the estimate of flippers in two muds."""
    return MudEstimate(left=left, right=right)


def stride(
    flipper: str = "left",
    depth_m: float = 0.03,
    released: bool = True,
    surface_m: float = 0.0,
    k_s: Estimate = NOT_REPORTED,
    k_e: Estimate = NOT_REPORTED,
    extraction_nm: float = nan,
    k_p: Estimate = NOT_REPORTED,
) -> StrideEstimate:
    return StrideEstimate(
        flipper=flipper,
        index=0,
        t_start_s=0.0,
        t_end_s=1.0,
        insertion_s=0.4,
        stance_s=0.25,
        extraction_s=0.1,
        k_p=k_p,
        k_s=k_s,
        k_e=k_e,
        surface_m=surface_m,
        depth_m=depth_m,
        released=released,
        insertion_force_n=3.0,
        stance_force_n=6.0,
        extraction_force_n=-2.0,
        step_m=nan,
        extraction_torque_nm=extraction_nm,
    )


def both(
    depth_m: float = 0.03, released: bool = True, surface_m: float = 0.0, extraction_nm: float = nan
) -> list[StrideEstimate]:
    return [stride(flipper, depth_m, released, surface_m, extraction_nm=extraction_nm) for flipper in FLIPPERS]


def plate_pieces(
    sweep_rad: float, depth_m: float, surface_m: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return ζ (depth), u (outward) and s (up from the lower edge's middle) of small wet pieces, and the area of one
    piece.
    """
    adduction_rad = GEOMETRY.adduction_rad(sweep_rad, depth_m)
    width_m, height_m = GEOMETRY.plate_width_m, GEOMETRY.plate_height_m
    u, s = np.meshgrid((np.arange(100) + 0.5) / 100 * width_m - width_m / 2, (np.arange(1400) + 0.5) / 1400 * height_m)
    outward = np.cos(sweep_rad) * np.sin(adduction_rad)
    depths = depth_m - surface_m - u * outward - s * np.cos(adduction_rad)
    wet = depths > 0.0
    return depths[wet], u[wet], s[wet], width_m * height_m / u.size


def thrust_m3(depth_m: float, surface_m: float = 0.0) -> float:
    """Return ∫ζ dA with the flipper straight out."""
    depths, _, _, piece_m2 = plate_pieces(0.0, depth_m, surface_m)
    return float(np.sum(depths)) * piece_m2


def lift_m4(depth_m: float, surface_m: float = 0.0) -> float:
    """Return the submerged volume times the path of its centre per radian, at the rear of the sweep."""
    rear_rad = -np.radians(GAIT.sweep_angle_deg)
    _, u, s, piece_m2 = plate_pieces(rear_rad, depth_m, surface_m)
    volume_m3 = GEOMETRY.plate_thickness_m * u.size * piece_m2
    path_m = np.hypot(GEOMETRY.flipper_length_m + np.mean(u), GEOMETRY.drop_m - np.mean(s)) * np.cos(rear_rad)
    return volume_m3 * float(path_m)
