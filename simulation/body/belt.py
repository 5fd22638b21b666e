"""The belt or gear between a motor and its joint, with play: inside it the motor turns alone.

The belt is a spring and a damper behind a dead zone, between the rotor with the drive's encoder and the arm. Inside the
zone it transmits nothing, and at its edge it never pulls back, which the damper of the plain dead zone would do
(Nordin, Galic & Gutman, Int. J. Adapt. Control 11, 1997, 49; survey: Nordin & Gutman, Automatica 38, 2002, 1633). Its
torque is solved for the end of a step, so that steps of any length are stable. Stiffness and damping are assumptions:
0.4 degrees at full torque, and a tenth of the critical damping. So is the dry friction of the rotor's bearings, a tenth
of the joints' in the authors' logs: without it a rotor at rest would coast through its play at the same speed for ever.
"""

from math import copysign

ROTOR_KG_M2 = 0.00015  # of a 60 mm motor, a part of the joint's inertia, at most half
STIFFNESS_NM_RAD = 100.0
DAMPING_NM_S_RAD = 0.02
FRICTION_NM = 0.005  # of the rotor


class Belt:
    """Owns the motion of one motor's rotor, in angles of its joint."""

    def __init__(self, play_rad: float, joint_inertia_kg_m2: float, friction_nm: float = FRICTION_NM) -> None:
        self._half_play_rad = play_rad / 2.0
        self.rotor_kg_m2 = rotor_kg_m2 = min(ROTOR_KG_M2, joint_inertia_kg_m2 / 2.0)
        self._slowing_rad_s2 = friction_nm / rotor_kg_m2
        self._per_inertia = 1.0 / rotor_kg_m2 + 1.0 / (joint_inertia_kg_m2 - rotor_kg_m2)
        self.put(0.0)

    def put(self, angle_rad: float) -> None:
        """Put the rotor at rest in the middle of its play."""
        self.angle_rad, self.velocity_rad_s = angle_rad, 0.0

    def transmit(self, dt_s: float, motor_nm: float, arm_rad: float, arm_rad_s: float) -> float:
        """Turn the rotor for a step; return the torque on the arm."""
        faster_rad_s = self.velocity_rad_s + dt_s * motor_nm / self.rotor_kg_m2 - arm_rad_s
        ahead_rad = self.angle_rad - arm_rad + dt_s * faster_rad_s
        side = 1.0 if ahead_rad > 0.0 else -1.0
        stretch_rad = side * ahead_rad - self._half_play_rad
        belt_nm = 0.0
        if stretch_rad > 0.0:
            rate_nm_rad_s = STIFFNESS_NM_RAD * dt_s + DAMPING_NM_S_RAD
            nm = STIFFNESS_NM_RAD * stretch_rad + DAMPING_NM_S_RAD * side * faster_rad_s
            belt_nm = side * max(nm / (1.0 + dt_s * rate_nm_rad_s * self._per_inertia), 0.0)
        velocity_rad_s = self.velocity_rad_s + dt_s * (motor_nm - belt_nm) / self.rotor_kg_m2
        self.velocity_rad_s = slowed(velocity_rad_s, dt_s * self._slowing_rad_s2)
        self.angle_rad += dt_s * self.velocity_rad_s
        return belt_nm


def slowed(velocity_rad_s: float, loss_rad_s: float) -> float:
    """Return the velocity after dry friction, which stops the joint but never reverses it."""
    return copysign(max(abs(velocity_rad_s) - loss_rad_s, 0.0), velocity_rad_s)
