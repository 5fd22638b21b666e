"""The submerged part of a flipper's plate and its moments about the joints: the geometry of the coefficients.

The plate hangs under the arm. The point u outward and s up from the middle of its lower edge lies at the depth

    ζ(u, s) = z - u cos α sin β - s cos β         z: depth of the edge's middle

so the mud's surface cuts the plate along a straight line, and the submerged part is a polygon. It is the sum, with
their signs, of the submerged regions above the outline's edges (plate_outline.py). Above an edge s₀(u) that region
reaches up to s₀(u) + D(u) / cos β with D(u) = ζ(u, s₀(u)). D is linear in u, so the integrals of 1, u, s, ζ, ζu and
ζs over the region are polynomials in the depths D₁, D₂ of the edge's two ends (zero for an end above the mud) and the
width w' between them. With q = cos β, (ū, s̄₀) the middle of the edge's submerged part and m = ds₀/du its slope:

    ∫dA   = w' (D₁ + D₂) / 2q                 ∫ζ dA  = w' (D₁² + D₁D₂ + D₂²) / 6q
    ∫u dA = ū ∫dA + w'² (D₂ - D₁) / 12q       ∫ζu dA = ū ∫ζ dA + w'² (D₂² - D₁²) / 24q
    ∫s dA  = w' (D₁² + D₁D₂ + D₂²) / 6q²      + s̄₀ ∫dA   + m w'² (D₂ - D₁) / 12q
    ∫ζs dA = w' (D₁ + D₂)(D₁² + D₂²) / 24q²   + s̄₀ ∫ζ dA + m w'² (D₂² - D₁²) / 24q

A rectangle is the region above its lower edge, less the one above its upper edge once that is submerged.

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
    q, plate = per_upward, geometry.plate
    top_is_dry = depth_m + abs(per_outward) * plate.reach_m <= plate.lowest_top_m * q
    area_m2 = outward_m3 = upward_m3 = depth_m3 = depth_outward_m4 = depth_upward_m4 = 0.0
    for inner_m, outer_m, height_m, outer_height_m, slope, sign in plate.lower_edges if top_is_dry else plate.edges:
        low_m = depth_m - height_m * q + per_outward * inner_m
        high_m = depth_m - outer_height_m * q + per_outward * outer_m
        from_m = inner_m
        if low_m < 0.0 or high_m < 0.0:
            if low_m <= 0.0 and high_m <= 0.0:
                continue
            if slope:
                waterline_m = inner_m + (outer_m - inner_m) * low_m / (low_m - high_m)
            else:
                waterline_m = -(depth_m - height_m * q) / per_outward
            if low_m < 0.0:
                low_m, inner_m = 0.0, waterline_m
            else:
                high_m, outer_m = 0.0, waterline_m
        wet_m, middle_m, sum_m = outer_m - inner_m, (inner_m + outer_m) / 2.0, low_m + high_m
        signed_m = sign * wet_m
        uneven_m2 = signed_m * wet_m * (high_m - low_m)
        part_m2 = signed_m * sum_m / (2.0 * q)
        part_m3 = signed_m * (low_m * low_m + low_m * high_m + high_m * high_m) / (6.0 * q)
        uneven_m3, uneven_m4 = uneven_m2 / (12.0 * q), uneven_m2 * sum_m / (24.0 * q)
        area_m2 += part_m2
        outward_m3 += middle_m * part_m2 + uneven_m3
        upward_m3 += part_m3 / q
        depth_m3 += part_m3
        depth_outward_m4 += middle_m * part_m3 + uneven_m4
        depth_upward_m4 += signed_m * sum_m * (low_m * low_m + high_m * high_m) / (24.0 * q * q)
        if height_m or slope:
            height_m += slope * (middle_m - from_m)
            upward_m3 += height_m * part_m2 + slope * uneven_m3
            depth_upward_m4 += height_m * part_m3 + slope * uneven_m4
    return SubmergedPlate(area_m2, outward_m3, upward_m3, depth_m3, depth_outward_m4, depth_upward_m4)


def mean_width_m(geometry: FlipperGeometry, depth_m: float) -> float:
    """Return the width of a rectangle with as much area down to this depth, of a plate on a level arm."""
    if geometry.has_level_rectangle or depth_m <= 0.0:
        return geometry.plate_width_m
    return submerged_part(geometry, depth_m, 0.0, 1.0).area_m2 / depth_m


def moment_width_m(geometry: FlipperGeometry, depth_m: float) -> float:
    """Return the width of a rectangle with the same ∫ζ dA = w z²/2, of a plate on a level arm."""
    if geometry.has_level_rectangle or depth_m <= 0.0:
        return geometry.plate_width_m
    return 2.0 * submerged_part(geometry, depth_m, 0.0, 1.0).depth_moment_m3 / (depth_m * depth_m)


def growth_exponent(geometry: FlipperGeometry, depth_m: float) -> float:
    """Return n of a volume that grows as z^n: 1 for a rectangle, 2 for a triangle on its tip.

    d/dz ∫ζ dA = A, so z A / ∫ζ dA = n + 1.
    """
    if geometry.has_level_rectangle:
        return 1.0
    return 2.0 * mean_width_m(geometry, depth_m) / moment_width_m(geometry, depth_m) - 1.0


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
