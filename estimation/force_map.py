"""The force on a flipper from its joint loads, for display and for the paper's method.

Two torques do not determine three force components. The default map takes the smallest force with these torques,
F = J (JᵀJ)⁻¹ τ with the whole Jacobian of the lower edge, drop h included:

    JᵀJ = [[l², -h l sin α], [-h l sin α, h² + l² cos² α]]

This is the force against the edge's motion; with known contact laws it is 0.8 to 1.0 of the true vertical force in
insertions down to 3 cm, and less accurate with a steep arm. In stance the load is along the plate's normal, and the
adduction joint measures only its cross-coupling: the upward force is unknown there and not reported.

The paper's map (section II-C) is rows x and z of J / l² at h = 0:

    f_x = cos α τ₁ / l          f_z = (-sin β sin α τ₁ + cos β cos α τ₂) / l
"""

from math import cos, sin

from control.geometry import FlipperGeometry


def smallest_force_n(
    geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, sweep_nm: float, adduction_nm: float
) -> tuple[float, float]:
    """Return (f_x forward, f_z up) on the flipper, in N."""
    l, h = geometry.flipper_length_m, geometry.drop_m  # noqa: E741
    sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)
    a, b, c = l * l, -h * l * sa, h * h + l * l * ca * ca
    determinant = a * c - b * b
    along_sweep = (c * sweep_nm - b * adduction_nm) / determinant
    along_adduction = (a * adduction_nm - b * sweep_nm) / determinant
    force_z_n = -l * sa * sb * along_sweep + (h * sb + l * ca * cb) * along_adduction
    return l * ca * along_sweep, force_z_n


def paper_force_n(
    sweep_rad: float, adduction_rad: float, sweep_nm: float, adduction_nm: float, length_m: float
) -> tuple[float, float]:
    """Return (f_x forward, f_z up) on the flipper, in N."""
    sa, ca = sin(sweep_rad), cos(sweep_rad)
    force_x_n = ca * sweep_nm / length_m
    force_z_n = (cos(adduction_rad) * ca * adduction_nm - sin(adduction_rad) * sa * sweep_nm) / length_m
    return force_x_n, force_z_n
