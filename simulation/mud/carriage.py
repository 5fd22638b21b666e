"""How a free body carries a flipper: the attitude and motion of its plate while the body turns and rises.

All vectors are in the flipper's own mirrored axes, fixed to the body: x forward, y outward, z up, with the unit vectors
of the plate, normal n = (cos α, -sin α cos β, -sin α sin β), outward r and upward s. The intersection of the joint axes
moves with V, the body turns with Ω, and the plate turns with w = Ω + β' x - α' s. A point u outward and s upward lies
at p = (l + u) r + (s - h) s from the intersection, so that its velocity V + w × p has the components

    v_n = V_n - w_s (l + u) + w_r (s - h)     v_r = V_r - w_n (s - h)     v_s = V_s + w_n (l + u)

With V = (X', 0, 0) and Ω = 0 these are those of flipper_contact.py. Depth is measured along the world's vertical.
"""

from math import cos, sin
from typing import NamedTuple

from control.geometry import FlipperGeometry
from simulation.mud.rigid_plate import Attitude, Twist
from simulation.mud.vectors import Vector, dot

LEAST_UPRIGHT = 0.05  # a plate cannot lie flat: its strips would be endless


class Carriage(NamedTuple):
    """The intersection of one flipper's joint axes at one time, in the flipper's own axes of the body."""

    height_m: float  # of the intersection above the mud's nominal surface
    up: Vector  # the world's vertical
    velocity_m_s: Vector
    turning_rad_s: Vector


def plate_directions(sweep_rad: float, adduction_rad: float) -> tuple[Vector, Vector, Vector]:
    """Return n, r and s."""
    sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)
    return (ca, -sa * cb, -sa * sb), (sa, ca * cb, ca * sb), (0.0, -sb, cb)


def carried_attitude(
    geometry: FlipperGeometry, carriage: Carriage, sweep_rad: float, adduction_rad: float, surface_m: float
) -> Attitude:
    normal, outward, upward = plate_directions(sweep_rad, adduction_rad)
    edge = geometry.edge_position(sweep_rad, adduction_rad)
    depth_m = -carriage.height_m - dot(carriage.up, edge) - surface_m
    upright = max(dot(carriage.up, upward), LEAST_UPRIGHT)
    return Attitude(depth_m, -dot(carriage.up, outward), upright, -dot(carriage.up, normal))


def carried_twist(
    geometry: FlipperGeometry,
    carriage: Carriage,
    sweep_rad: float,
    adduction_rad: float,
    sweep_rad_s: float,
    adduction_rad_s: float,
) -> Twist:
    n, r, s = plate_directions(sweep_rad, adduction_rad)
    length_m, drop_m = geometry.flipper_length_m, geometry.drop_m
    roll_rad_s, pitch_rad_s, yaw_rad_s = carriage.turning_rad_s
    turning = (roll_rad_s + adduction_rad_s, pitch_rad_s, yaw_rad_s)
    w_n, w_r, w_s = dot(turning, n), dot(turning, r), dot(turning, s) - sweep_rad_s
    return Twist(
        dot(carriage.velocity_m_s, n) - w_s * length_m - w_r * drop_m,
        dot(carriage.velocity_m_s, r) + w_n * drop_m,
        dot(carriage.velocity_m_s, s) + w_n * length_m,
        -w_s,
        w_r,
        -w_n,
        w_n,
    )
