"""Friction and cogging of a joint's motor, if a calibration has measured them.

Direct-drive motors have little of either (the paper neglects both), so everything is zero unless configured:

    τ = c tanh(ω / ω₀) + d ω + A sin(n θ + φ)          Coulomb, viscous, cogging

is the torque that the motor loses at the angle θ and the velocity ω. The bounds suit motors of this size.
"""

from dataclasses import dataclass
from math import radians, sin, tanh
from typing import Annotated

from control.bounds import Bounds, Meaning

SLOW_RAD_S = 0.05  # below it the direction of dry friction is uncertain


@dataclass(frozen=True)
class JointFriction:
    coulomb_nm: Annotated[float, Bounds(0.0, 0.5), Meaning("dry friction, against the motion")] = 0.0
    viscous_nm_s: Annotated[float, Bounds(0.0, 0.1), Meaning("friction that grows with speed", "N·m·s/rad")] = 0.0
    cogging_nm: Annotated[float, Bounds(0.0, 0.5), Meaning("amplitude of the torque of the magnets")] = 0.0
    cogging_per_turn: Annotated[int, Bounds(0, 1000), Meaning("periods of the cogging in one turn", "1/turn")] = 0
    cogging_phase_deg: Annotated[float, Bounds(-360.0, 360.0), Meaning("of the cogging at joint angle zero")] = 0.0

    def torque_nm(self, angle_rad: float, velocity_rad_s: float) -> float:
        cogging_rad = self.cogging_per_turn * angle_rad + radians(self.cogging_phase_deg)
        moving_nm = self.coulomb_nm * tanh(velocity_rad_s / SLOW_RAD_S) + self.viscous_nm_s * velocity_rad_s
        return moving_nm + self.cogging_nm * sin(cogging_rad)


NO_FRICTION = JointFriction()
