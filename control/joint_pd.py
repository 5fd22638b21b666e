"""Joint PD control with gravity feed-forward: τ = k (θ* - θ) + d (ω* - ω) - τ_gravity(α, β).

The drives run in torque mode, so this law and its limits are all that moves the robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Annotated

from control.bounds import Bounds
from control.records import DriveState, FlipperTarget, JointTarget

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class JointGains:
    """At 380 Hz with samples up to 2 ms old, damping over arm inertia should stay under about 150 rad/s."""

    sweep_stiffness_nm_rad: Annotated[float, Bounds(0.0, 200.0)] = 12.0
    sweep_damping_nm_s_rad: Annotated[float, Bounds(0.0, 5.0)] = 0.10
    adduction_stiffness_nm_rad: Annotated[float, Bounds(0.0, 200.0)] = 18.0
    adduction_damping_nm_s_rad: Annotated[float, Bounds(0.0, 5.0)] = 0.15


@dataclass(frozen=True)
class ArmMass:
    """Of one flipper arm with all that its adduction joint lifts, as a point on the arm."""

    arm_mass_kg: Annotated[float, Bounds(0.0, 20.0)] = 0.08
    center_of_mass_m: Annotated[float, Bounds(0.0, 1.0)] = 0.06  # from the axes, along the arm

    def gravity_torques_nm(self, sweep_rad: float, adduction_rad: float) -> tuple[float, float]:
        """What gravity does to (sweep, adduction): -∂/∂q of m g r cos α sin β."""
        moment_nm = self.arm_mass_kg * GRAVITY_M_S2 * self.center_of_mass_m
        sweep_nm = moment_nm * sin(sweep_rad) * sin(adduction_rad)
        return sweep_nm, -moment_nm * cos(sweep_rad) * cos(adduction_rad)


def pd_torque_nm(
    target: JointTarget, state: DriveState, stiffness_nm_rad: float, damping_nm_s_rad: float
) -> float:
    return stiffness_nm_rad * (target.angle_rad - state.angle_rad) + damping_nm_s_rad * (
        target.velocity_rad_s - state.velocity_rad_s
    )


def flipper_torques_nm(
    target: FlipperTarget, sweep: DriveState, adduction: DriveState, gains: JointGains, mass: ArmMass, gain: float
) -> tuple[float, float]:
    """(sweep, adduction) torques; `gain` from 0 to 1 fades the joints in after arming."""
    gravity_sweep_nm, gravity_adduction_nm = mass.gravity_torques_nm(sweep.angle_rad, adduction.angle_rad)
    sweep_nm = pd_torque_nm(target.sweep, sweep, gains.sweep_stiffness_nm_rad, gains.sweep_damping_nm_s_rad)
    adduction_nm = pd_torque_nm(
        target.adduction, adduction, gains.adduction_stiffness_nm_rad, gains.adduction_damping_nm_s_rad
    )
    return gain * (sweep_nm - gravity_sweep_nm), gain * (adduction_nm - gravity_adduction_nm)
