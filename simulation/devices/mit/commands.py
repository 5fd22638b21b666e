"""The commands of MIT mode as a drive understands them, with gains: its own reading of the bits, by the firmware."""

from typing import NamedTuple

KP_NM_RAD, KD_NM_S_RAD = 500.0, 5.0  # the largest gains
STEPS = 4095


class Command(NamedTuple):
    position_rad: float = 0.0
    velocity_rad_s: float = 0.0
    kp_nm_rad: float = 0.0
    kd_nm_s_rad: float = 0.0
    torque_nm: float = 0.0


AT_REST = Command()


def decode_command(data: bytes, position_rad: float, velocity_rad_s: float, torque_nm: float) -> Command:
    """Decode a payload of eight bytes by a drive's ranges: unpack_cmd of Core/Src/can.c of bgkatz/motorcontrol."""
    number = int.from_bytes(data, "big")
    torque, kd, kp, velocity = (number >> shift & 0xFFF for shift in (0, 12, 24, 36))
    return Command(
        (number >> 48) * 2.0 * position_rad / 65535.0 - position_rad,
        velocity * 2.0 * velocity_rad_s / STEPS - velocity_rad_s,
        kp * KP_NM_RAD / STEPS,
        kd * KD_NM_S_RAD / STEPS,
        torque * 2.0 * torque_nm / STEPS - torque_nm,
    )
