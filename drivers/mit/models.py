"""The ranges of the motors that speak MIT mode: position, velocity and torque are codes within them, so both ends must
use the same.

CubeMars: AK Series Actuator Driver Manual V1.0.8, page 50, for the firmware of that manual (V1 and V2 of the motors;
V3 speaks another protocol). `TMotorCANControl` 1.2.6 (MIT_Params of mit_can.py) has the same but for the AK60-6, with
±50 rad/s. Other firmware has other ranges of velocity: the DFKI's driver 0.4.3 has ±22.5 rad/s for an AK80-9 V1.1 and
±25.64 for a V2. The key velocity_range_rad_s sets it. Damiao: the table of damiao-motor 1.0.6 (core/motor.py), the
values of delivery of the registers 21 to 23, which are read back. RobStride: User Manuals of 2026-04-28, section 6 (MIT
protocol) and the sample program. Where these two disagree on the velocity (RS02: 33 and 44 rad/s, RS03: 33 and 20), the
sample program's stands here; RS04 and EL05, where they disagree on position or torque, are left out.
"""

from collections.abc import Mapping
from typing import NamedTuple

TORQUE_CODES = 4095  # steps of a 12-bit code


class Model(NamedTuple):
    """One motor's ranges, each from minus to plus."""

    position_rad: float
    velocity_rad_s: float
    torque_nm: float
    source: str  # the document that states them, with its page
    has_registers: bool = False  # Damiao: limits and time-out can be read, and every answer says whether it follows
    reports_faults_apart: bool = False  # RobStride: under its master's id, with a wide temperature, faults when asked

    @property
    def torque_step_nm(self) -> float:
        return 2.0 * self.torque_nm / TORQUE_CODES

    def with_ranges(self, velocity_rad_s: float, torque_nm: float) -> "Model":
        """Return the model with ranges that are not as delivered; one that is not positive stays."""
        return self._replace(
            velocity_rad_s=velocity_rad_s if velocity_rad_s > 0.0 else self.velocity_rad_s,
            torque_nm=torque_nm if torque_nm > 0.0 else self.torque_nm,
        )


def _cubemars(position_rad: float, velocity_rad_s: float, torque_nm: float) -> Model:
    return Model(position_rad, velocity_rad_s, torque_nm, "CubeMars manual V1.0.8, p. 50")


def _damiao(position_rad: float, velocity_rad_s: float, torque_nm: float) -> Model:
    return Model(position_rad, velocity_rad_s, torque_nm, "damiao-motor 1.0.6, core/motor.py", has_registers=True)


def _robstride(velocity_rad_s: float, torque_nm: float) -> Model:
    return Model(12.57, velocity_rad_s, torque_nm, "RobStride User Manual 260428", reports_faults_apart=True)


MODELS: Mapping[str, Model] = {
    "AK10-9": _cubemars(12.5, 50.0, 65.0),
    "AK60-6": _cubemars(12.5, 45.0, 15.0),
    "AK70-10": _cubemars(12.5, 50.0, 25.0),
    "AK80-6": _cubemars(12.5, 76.0, 12.0),
    "AK80-9": _cubemars(12.5, 50.0, 18.0),
    "AK80-64": _cubemars(12.5, 8.0, 144.0),
    "DM3507": _damiao(12.566, 50.0, 5.0),
    "DM4310": _damiao(12.5, 30.0, 10.0),
    "DM4310P": _damiao(12.5, 50.0, 10.0),
    "DM4340": _damiao(12.5, 10.0, 28.0),
    "DM4340P": _damiao(12.5, 10.0, 28.0),
    "DM6006": _damiao(12.5, 45.0, 20.0),
    "DM6248P": _damiao(12.566, 20.0, 120.0),
    "DM8006": _damiao(12.5, 45.0, 40.0),
    "DM8009": _damiao(12.5, 45.0, 54.0),
    "DM10010": _damiao(12.5, 20.0, 200.0),
    "DM10010L": _damiao(12.5, 25.0, 200.0),
    "DMG6215": _damiao(12.5, 45.0, 10.0),
    "DMH3510": _damiao(12.5, 280.0, 1.0),
    "DMH6220": _damiao(12.5, 45.0, 10.0),
    "DMJH11": _damiao(12.5, 10.0, 12.0),
    "RS00": _robstride(33.0, 14.0),
    "RS01": _robstride(44.0, 17.0),
    "RS02": _robstride(44.0, 17.0),
    "RS03": _robstride(20.0, 60.0),
    "RS05": _robstride(50.0, 5.5),
    "RS06": _robstride(50.0, 36.0),
}
