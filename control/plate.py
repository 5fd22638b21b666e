"""The submerged part of a flipper's plate and its moments about the joints: the geometry of the coefficients.

The plate of width b hangs under the arm. The point u outward and s up from the middle of its lower edge lies at the
depth

    ζ(u, s) = z - u cos α sin β - s cos β         z: depth of the edge's middle

so the mud's surface cuts the plate along a straight line, and the submerged part is a polygon: over the submerged
length of the edge, from s = 0 up to s = D(u) / cos β with D(u) = ζ(u, 0), or up to the plate's top if that is submerged
too. D is linear in u, so the integrals of 1, u, s, ζ, ζu and ζs over the polygon are polynomials in the depths D₁,
D₂ of the edge's two ends (zero for an end above the mud) and the width w' between them. With q = cos β, ū the middle:

    ∫dA   = w' (D₁ + D₂) / 2q                 ∫ζ dA  = w' (D₁² + D₁D₂ + D₂²) / 6q
    ∫u dA = ū ∫dA + w'² (D₂ - D₁) / 12q       ∫ζu dA = ū ∫ζ dA + w'² (D₂² - D₁²) / 24q
    ∫s dA = w' (D₁² + D₁D₂ + D₂²) / 6q²       ∫ζs dA = w' (D₁ + D₂)(D₁² + D₂²) / 24q²

The part above a submerged top is the same polygon at depths reduced by the plate's height, and is subtracted.

The coefficients are stiffnesses per volume, N/m³, in the paper's sense (section III-B):

    stance                   pressure k_s ζ on the face                  τ₁ = k_s Ψ    Ψ = ∫ζ (l + u) dA
    insertion, extraction    F = k V on the submerged volume V = t A,    τ₂ = k Φ      Φ = V cos α √((l+ū)² + (h-s̄)²)
                             against the motion of its centre (ū, s̄)

The root is the path of that centre per radian of adduction, within the plate's plane. (The sweep joint measures the
load across the face: see `cross_coupling`.) A plate that moves straight down in the same attitude has F_z = k V by
the same law, so a flipper and a load cell are comparable.
"""

from math import cos, sin, sqrt
from typing import NamedTuple

from control.geometry import FlipperGeometry


class SubmergedPlate(NamedTuple):
    """Integrals over the submerged part of one face; u outward, s up, ζ depth."""

    area_m2: float  # ∫dA
    area_outward_m3: float  # ∫u dA
    area_upward_m3: float  # ∫s dA
    depth_moment_m3: float  # ∫ζ dA
    depth_moment_outward_m4: float  # ∫ζu dA
    depth_moment_upward_m4: float  # ∫ζs dA


DRY = SubmergedPlate(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def submerged_plate(
    geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, surface_m: float = 0.0
) -> SubmergedPlate:
    """Return the integrals in a pose; `surface_m` is the depth of the mud's surface below its nominal height."""
    lean, q = cos(sweep_rad) * sin(adduction_rad), cos(adduction_rad)
    depth_m = geometry.drop_m * q - geometry.flipper_length_m * lean - geometry.axis_height_m - surface_m
    return submerged_part(geometry, depth_m, -lean, q)


def submerged_part(geometry: FlipperGeometry, depth_m: float, per_outward: float, per_upward: float) -> SubmergedPlate:
    """Return the integrals from the depth of the edge's middle, its gain outward and its loss upward."""
    below = _below(depth_m, per_outward, per_upward, geometry.plate_width_m)
    top_m = geometry.plate_height_m
    if depth_m + abs(per_outward) * geometry.plate_width_m / 2.0 <= top_m * per_upward:
        return below
    a, au, as_, z, zu, zs = _below(depth_m - top_m * per_upward, per_outward, per_upward, geometry.plate_width_m)
    return SubmergedPlate(
        below.area_m2 - a,
        below.area_outward_m3 - au,
        below.area_upward_m3 - as_ - top_m * a,
        below.depth_moment_m3 - z,
        below.depth_moment_outward_m4 - zu,
        below.depth_moment_upward_m4 - zs - top_m * z,
    )


def _below(depth_m: float, per_outward: float, q: float, width_m: float) -> SubmergedPlate:
    """Return the integrals of a plate that extends upward without end."""
    half_m = width_m / 2.0
    low_m, high_m = depth_m - per_outward * half_m, depth_m + per_outward * half_m
    inner_m, outer_m = -half_m, half_m
    if low_m < 0.0 or high_m < 0.0:
        if low_m <= 0.0 and high_m <= 0.0:
            return DRY
        waterline_m = -depth_m / per_outward
        if low_m < 0.0:
            low_m, inner_m = 0.0, waterline_m
        else:
            high_m, outer_m = 0.0, waterline_m
    wet_m, middle_m = outer_m - inner_m, (inner_m + outer_m) / 2.0
    rise_m = high_m - low_m
    area_m2 = wet_m * (low_m + high_m) / (2.0 * q)
    moment_m3 = wet_m * (low_m * low_m + low_m * high_m + high_m * high_m) / (6.0 * q)
    return SubmergedPlate(
        area_m2,
        middle_m * area_m2 + wet_m * wet_m * rise_m / (12.0 * q),
        moment_m3 / q,
        moment_m3,
        middle_m * moment_m3 + wet_m * wet_m * rise_m * (low_m + high_m) / (24.0 * q),
        wet_m * (low_m + high_m) * (low_m * low_m + high_m * high_m) / (24.0 * q * q),
    )


def stance_moment_m4(geometry: FlipperGeometry, plate: SubmergedPlate) -> float:
    """Return Ψ, the sweep torque per unit of k_s."""
    return geometry.flipper_length_m * plate.depth_moment_m3 + plate.depth_moment_outward_m4


def stroke_moment_m4(geometry: FlipperGeometry, plate: SubmergedPlate, sweep_rad: float) -> float:
    """Return Φ, the adduction torque per unit of k_p or k_e."""
    if plate.area_m2 <= 0.0:
        return 0.0
    outward_m = geometry.flipper_length_m + plate.area_outward_m3 / plate.area_m2
    below_arm_m = geometry.drop_m - plate.area_upward_m3 / plate.area_m2
    volume_m3 = geometry.plate_thickness_m * plate.area_m2
    return volume_m3 * cos(sweep_rad) * sqrt(outward_m * outward_m + below_arm_m * below_arm_m)


def cross_coupling(geometry: FlipperGeometry, plate: SubmergedPlate, sweep_rad: float) -> float:
    """Return the adduction torque per sweep torque of a load across the plate's face: -e sin α / (l + u).

    A load f_n at the pressure centre acts on the sweep joint with (l + u) f_n and on the adduction joint with
    -e sin α f_n, where e is its distance below the arm. In insertion and extraction the sweep torque therefore gives
    the part of the adduction torque to subtract.
    """
    stance_m4 = stance_moment_m4(geometry, plate)
    below_m, outward_m = geometry.drop_m, geometry.flipper_length_m
    if stance_m4 > 0.0:
        below_m = geometry.drop_m * plate.depth_moment_m3 - plate.depth_moment_upward_m4
        outward_m = stance_m4
    return -sin(sweep_rad) * below_m / outward_m
