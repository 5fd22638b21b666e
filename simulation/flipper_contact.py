"""One flipper in clay: its joints' motion as the plate's, and the plate's forces as torques and thrust.

The plate hangs under the arm, normal n in the direction of the sweep, in-plane directions r (outward along the arm)
and s (up along the plate). In the frame that tilts with adduction, the point u outward and s up from the middle of
the lower edge stands at ((l + u) sin α, (l + u) cos α, s - h) and moves with

    v_n = (l + u) α' + X' cos α - (h - s) sin α β'    v_r = X' sin α + (h - s) cos α β'    v_s = (l + u) cos α β'

where X' is the body's speed. The same coefficients, transposed, turn the mud's forces into joint torques and thrust;
its depth is ζ = z - u cos α sin β - s cos β. A stone's push on the lower edge, F_x forward and F_z up, is along them

    F_n = F_x cos α - F_z sin α sin β    F_r = F_x sin α + F_z cos α sin β    F_s = F_z cos β
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, cos, sin
from operator import add
from typing import NamedTuple

from control.geometry import FlipperGeometry
from simulation.clay import Clay
from simulation.plate_contact import NO_WRENCH, Attitude, PlateContact, PlateSize, Twist, Wrench, lowest_point_m
from simulation.stones import NO_PUSH, Push, Stone, StoneContact


class ContactForce(NamedTuple):
    sweep_nm: float
    adduction_nm: float
    thrust_n: float  # forward, on the body
    normal_n: float  # along the plate's normal
    outward_n: float  # along the arm
    upward_n: float  # along the plate, up: in insertion positive


NO_CONTACT = ContactForce(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def plate_size(geometry: FlipperGeometry) -> PlateSize:
    return PlateSize(geometry.plate_width_m, geometry.plate_height_m, geometry.plate_thickness_m)


def attitude_of(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, surface_m: float = 0.0) -> Attitude:
    depth_m = geometry.depth_m(sweep_rad, adduction_rad) - surface_m
    return Attitude(depth_m, -cos(sweep_rad) * sin(adduction_rad), cos(adduction_rad))


def lowest_m(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> float:
    """Depth of the plate's lower corner below the mud's nominal surface."""
    return lowest_point_m(attitude_of(geometry, sweep_rad, adduction_rad), geometry.plate_width_m)


def twist_of(
    geometry: FlipperGeometry, sweep_rad: float, sweep_rad_s: float, adduction_rad_s: float, body_m_s: float
) -> Twist:
    """Of the plate's motion through the mud. (It is the same whatever the adduction angle.)"""
    length_m, drop_m, sa, ca = geometry.flipper_length_m, geometry.drop_m, sin(sweep_rad), cos(sweep_rad)
    return Twist(
        length_m * sweep_rad_s + body_m_s * ca - drop_m * sa * adduction_rad_s,
        body_m_s * sa + drop_m * ca * adduction_rad_s,
        length_m * ca * adduction_rad_s,
        sweep_rad_s,
        sa * adduction_rad_s,
        -ca * adduction_rad_s,
        ca * adduction_rad_s,
    )


def contact_force(geometry: FlipperGeometry, sweep_rad: float, wrench: Wrench) -> ContactForce:
    """The transpose of `twist_of`: torques and thrust do the same work on joints and body as the mud on the plate."""
    length_m, drop_m, sa, ca = geometry.flipper_length_m, geometry.drop_m, sin(sweep_rad), cos(sweep_rad)
    across_nm = drop_m * wrench.normal_n - wrench.normal_upward_nm
    outward_nm = drop_m * wrench.outward_n - wrench.outward_upward_nm
    lifting_nm = length_m * wrench.upward_n + wrench.upward_outward_nm
    return ContactForce(
        length_m * wrench.normal_n + wrench.normal_outward_nm,
        ca * (outward_nm + lifting_nm) - sa * across_nm,
        ca * wrench.normal_n + sa * wrench.outward_n,
        wrench.normal_n,
        wrench.outward_n,
        wrench.upward_n,
    )


def push_wrench(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float, push: Push) -> Wrench:
    """Of a stone: forward on the middle of the lower edge, upward on its lower corner."""
    sa, ca, sb, cb = sin(sweep_rad), cos(sweep_rad), sin(adduction_rad), cos(adduction_rad)
    corner_m = copysign(geometry.plate_width_m / 2.0, -ca * sb)
    upright_n, upward_n = -push.upward_n * sa * sb, push.upward_n * cb
    return Wrench(
        push.forward_n * ca + upright_n,
        push.forward_n * sa + push.upward_n * ca * sb,
        upward_n,
        normal_outward_nm=upright_n * corner_m,
        upward_outward_nm=upward_n * corner_m,
    )


class FlipperContact:
    """Owns the contact of one flipper's plate with mud and with stones."""

    def __init__(self, geometry: FlipperGeometry, relaxation: float = 0.0, stones: Sequence[Stone] = ()) -> None:
        self.geometry = geometry
        self.plate = PlateContact(plate_size(geometry), relaxation)
        self.stones = StoneContact(stones) if stones else None

    def reset(self) -> None:
        self.plate.reset()
        if self.stones:
            self.stones.reset()

    def step(
        self,
        dt_s: float,
        clay: Clay,
        sweep_rad: float,
        adduction_rad: float,
        sweep_velocity_rad_s: float,
        adduction_velocity_rad_s: float,
        body_velocity_m_s: float,
        surface_m: float = 0.0,
        body_m: float = 0.0,
    ) -> ContactForce:
        """`surface_m`: how far the mud's surface lies below its nominal height; `body_m`: place along the track."""
        attitude = attitude_of(self.geometry, sweep_rad, adduction_rad, surface_m)
        pushed = self._pushed(dt_s, sweep_rad, adduction_rad, body_m) if self.stones else NO_WRENCH
        if self.plate.leaves(attitude):  # as in swing: nothing else to compute
            return contact_force(self.geometry, sweep_rad, pushed) if pushed is not NO_WRENCH else NO_CONTACT
        twist = twist_of(self.geometry, sweep_rad, sweep_velocity_rad_s, adduction_velocity_rad_s, body_velocity_m_s)
        wrench = self.plate.step(dt_s, clay, attitude, twist)
        if pushed is not NO_WRENCH:
            wrench = Wrench(*map(add, wrench, pushed))
        return contact_force(self.geometry, sweep_rad, wrench)

    def _pushed(self, dt_s: float, sweep_rad: float, adduction_rad: float, body_m: float) -> Wrench:
        """By a stone."""
        assert self.stones is not None
        place_m = body_m + self.geometry.flipper_length_m * sin(sweep_rad)
        push = self.stones.step(dt_s, place_m, lowest_m(self.geometry, sweep_rad, adduction_rad))
        return NO_WRENCH if push is NO_PUSH else push_wrench(self.geometry, sweep_rad, adduction_rad, push)
