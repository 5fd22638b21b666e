"""A motor and its encoder between a drive and a joint, with what differs from ideal ones, alike for every protocol.

Cogging is the torque of a motor's magnets, which pull the rotor towards detents at any current. It is the slope of an
energy that repeats n times a turn, so over a turn it does no work. It is no pure sine:

    τ = -A [sin(n θ + φ) + 0.25 sin(2 (n θ + φ))]         the second harmonic is an assumption
"""

from math import cos, pi, radians, sin
from random import Random

from simulation.devices.drive import SimulatedDriveParameters

TURN_RAD = 2.0 * pi
SECOND_HARMONIC = 0.25


def joint_torque_nm(parameters: SimulatedDriveParameters, torque_nm: float, turns: float) -> float:
    """Returns the joint's torque. `torque_nm` is the motor's by the drive's own torque constant, `turns` its angle."""
    torque_nm *= 1.0 + parameters.torque_constant_error
    if parameters.commutation_error_deg:
        torque_nm *= cos(radians(parameters.commutation_error_deg))
    if parameters.cogging_nm:
        angle = parameters.cogging_per_turn * 2.0 * pi * turns + radians(parameters.cogging_phase_deg)
        torque_nm -= parameters.cogging_nm * (sin(angle) + SECOND_HARMONIC * sin(2.0 * angle))
    return parameters.sign * torque_nm


def encoder_turns(parameters: SimulatedDriveParameters, turns: float, random: Random) -> float:
    """Returns the angle that an encoder with offset, noise and steps reports."""
    error_rad = parameters.encoder_offset_rad
    if parameters.encoder_noise_rad:
        error_rad += random.gauss(0.0, parameters.encoder_noise_rad)
    turns += parameters.sign * error_rad / TURN_RAD
    return round(turns * parameters.encoder_counts) / parameters.encoder_counts
