"""The torque of a motor's magnets, which pull the rotor towards detents at any current.

Cogging is the slope of an energy that repeats n times a turn, so over a turn it does no work. It is no pure sine:

    τ = -A [sin(n θ + φ) + 0.25 sin(2 (n θ + φ))]         the second harmonic is an assumption
"""

from math import pi, radians, sin

from simulation.devices.drive import SimulatedDriveParameters

SECOND_HARMONIC = 0.25


def cogging_torque_nm(parameters: SimulatedDriveParameters, turns: float) -> float:
    """Returns the torque at the motor, from its true angle."""
    angle = parameters.cogging_per_turn * 2.0 * pi * turns + radians(parameters.cogging_phase_deg)
    return -parameters.cogging_nm * (sin(angle) + SECOND_HARMONIC * sin(2.0 * angle))
