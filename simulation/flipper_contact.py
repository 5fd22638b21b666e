"""One rigid flipper in clay: an anchored elastic-plastic contact in the plate's own three directions.

The plate hangs under the arm, normal n in the direction of the sweep, in-plane directions r (outwards along the arm)
and s (up along the plate). Mud holds the plate like a spring on each of them until its yield force is reached, from
where on the anchor drags behind. In the frame that tilts with adduction the resultant acts at (l sin α, l cos α, -e),
e below the arm, which moves with

    v_n = l α' + X' cos α - e sin α β'      v_r = X' sin α + e cos α β'      v_s = l cos α β'

where X' is the body's speed. The same coefficients, transposed, turn the forces into joint torques and thrust.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

from control.geometry import FlipperGeometry
from simulation.clay import Clay, Plate, rate_factor

LATERAL_STIFFNESS_N_M = 1500.0  # speeds of the walking model hardly change between 400 and 1500
EDGE_STIFFNESS_N_M = 2000.0


class ContactForce(NamedTuple):
    sweep_nm: float
    adduction_nm: float
    thrust_n: float  # forward, on the body
    normal_n: float  # along the plate's normal
    upward_n: float  # along the plate, up: in insertion positive


NO_CONTACT = ContactForce(0.0, 0.0, 0.0, 0.0, 0.0)


class FlipperContact:
    """Owns the elastic displacement of the mud around one plate."""

    def __init__(self, geometry: FlipperGeometry) -> None:
        self.geometry = geometry
        self.plate = Plate(geometry.plate_width_m, geometry.plate_thickness_m)
        self.reset()

    def reset(self) -> None:
        self._normal_m = self._outward_m = self._upward_m = 0.0

    def step(
        self,
        dt_s: float,
        clay: Clay,
        sweep_rad: float,
        adduction_rad: float,
        sweep_velocity_rad_s: float,
        adduction_velocity_rad_s: float,
        body_velocity_m_s: float,
    ) -> ContactForce:
        depth_m = self.geometry.depth_m(sweep_rad, adduction_rad)
        if depth_m <= 0.0:
            self.reset()
            return NO_CONTACT
        sa, ca, length_m = sin(sweep_rad), cos(sweep_rad), self.geometry.flipper_length_m
        center_m = depth_m - clay.lateral_center_m(depth_m, self.plate.width_m)
        arm_m = self.geometry.drop_m - center_m / cos(adduction_rad)
        normal_n, outward_n, upward_n = self._yield(
            dt_s,
            clay,
            depth_m,
            length_m * sweep_velocity_rad_s + body_velocity_m_s * ca - arm_m * sa * adduction_velocity_rad_s,
            body_velocity_m_s * sa + arm_m * ca * adduction_velocity_rad_s,
            length_m * ca * adduction_velocity_rad_s,
        )
        return ContactForce(
            length_m * normal_n,
            arm_m * (ca * outward_n - sa * normal_n) + length_m * ca * upward_n,
            ca * normal_n + sa * outward_n,
            normal_n,
            upward_n,
        )

    def _yield(
        self, dt_s: float, clay: Clay, depth_m: float, normal_m_s: float, outward_m_s: float, upward_m_s: float
    ) -> tuple[float, float, float]:
        """Forces along the plate's directions after it moved on for `dt_s`."""
        rate = rate_factor(sqrt(normal_m_s**2 + outward_m_s**2 + upward_m_s**2))
        lateral_n = rate * clay.lateral_n(depth_m, self.plate.width_m)
        edgewise_n = rate * clay.edgewise_n(depth_m, self.plate)
        insertion_n = rate * clay.insertion_n(depth_m, self.plate)
        extraction_n = rate * clay.extraction_n(depth_m, self.plate)
        self._normal_m, normal_n = _yielding(
            self._normal_m + normal_m_s * dt_s, LATERAL_STIFFNESS_N_M, lateral_n, lateral_n
        )
        self._outward_m, outward_n = _yielding(
            self._outward_m + outward_m_s * dt_s, EDGE_STIFFNESS_N_M, edgewise_n, edgewise_n
        )
        self._upward_m, upward_n = _yielding(
            self._upward_m + upward_m_s * dt_s, EDGE_STIFFNESS_N_M, insertion_n, extraction_n
        )
        return normal_n, outward_n, upward_n


def _yielding(
    displacement_m: float, stiffness_n_m: float, largest_n: float, largest_pull_n: float
) -> tuple[float, float]:
    """(elastic displacement left, force) of a spring that slides at its yield forces in push and pull."""
    force_n = min(max(-stiffness_n_m * displacement_m, -largest_pull_n), largest_n)
    return -force_n / stiffness_n_m, force_n
