"""From motor current to what the mud does to a flipper, by the paper's own map (section II-C).

Of a direct-drive joint the motor's torque k_t I, gravity and the mud's load together make the arm's inertia J turn
faster: the load is J ω' - k_t I - τ_gravity. (The paper leaves inertia and gravity out; with both set to zero in the
configuration this is its -k_t I.) The paper's matrix turns the loads of sweep and adduction, τ₁ and τ₂, into the
forward and the upward force on the flipper:

    f_x = cos α τ₁ / l          f_z = (-sin β sin α τ₁ + cos β cos α τ₂) / l

It is exact for stance force along the plate's normal and off by tens of percent in insertion, since it leaves out
the drop h and the lateral force.
"""

from math import cos, sin


def mud_torque_nm(motor_nm: float, gravity_nm: float, inertial_nm: float) -> float:
    return inertial_nm - motor_nm - gravity_nm


def paper_force_n(
    sweep_rad: float, adduction_rad: float, sweep_nm: float, adduction_nm: float, length_m: float
) -> tuple[float, float]:
    """(f_x forward, f_z up) on the flipper, in N."""
    sa, ca = sin(sweep_rad), cos(sweep_rad)
    force_x_n = ca * sweep_nm / length_m
    force_z_n = (cos(adduction_rad) * ca * adduction_nm - sin(adduction_rad) * sa * sweep_nm) / length_m
    return force_x_n, force_z_n
