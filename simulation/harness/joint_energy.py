"""Measures the energy that the motors' torque puts into each joint, independently of the controller's estimates.

The work of a motor is the integral of its true torque over the true path of its joint. Its sum may fall, because a
braking motor takes energy out, so the energy of a failure is the largest rise of that sum over any interval since the
onset: it neither hides behind earlier braking nor grows while the joint is braked.
"""

from dataclasses import dataclass, field

from control.limits import JointRange
from control.records import JointAngles, Joints, Torques
from simulation.body.plant import END_STOPS_RAD
from simulation.harness.robot import SimulatedRobot

AT_STOP_RAD = 1e-6  # a joint that rests against its mechanical stop has exactly the stop's angle
PUSHING_NM = 0.05  # more than cogging


@dataclass
class JointWork:
    """The measurements of one joint since the onset."""

    work_j: float = 0.0  # net, negative where the motor braked
    energy_j: float = 0.0  # the largest net work over any interval
    peak_speed_rad_s: float = 0.0
    beyond_rad: float = 0.0  # the largest angle past the configured range
    pushed_s: float = 0.0  # against a mechanical stop by the motor
    _lowest_j: float = field(default=0.0, repr=False)

    def add(self, work_j: float) -> None:
        self.work_j += work_j
        self._lowest_j = min(self._lowest_j, self.work_j)
        self.energy_j = max(self.energy_j, self.work_j - self._lowest_j)


class JointEnergy:
    """Owns the work of all joints of a simulated robot since `begin`; it observes every step of the mechanics."""

    def __init__(self, robot: SimulatedRobot, ranges: Joints[JointRange]) -> None:
        self._plant = robot.plant
        self._ranges = ranges
        self.begin()
        robot.observers.append(self._update)

    def begin(self) -> None:
        """Start again from zero: the onset of a failure."""
        self._before_rad: JointAngles = self._plant.angles_rad
        self.joints: Joints[JointWork] = self._ranges.map(lambda _: JointWork())

    @property
    def energy_j(self) -> float:
        """The energy of the joint that received most."""
        return max(joint.energy_j for joint in self.joints)

    @property
    def peak_speed_rad_s(self) -> float:
        return max(joint.peak_speed_rad_s for joint in self.joints)

    @property
    def beyond_rad(self) -> float:
        return max(joint.beyond_rad for joint in self.joints)

    @property
    def pushed_s(self) -> float:
        return max(joint.pushed_s for joint in self.joints)

    def _update(self, dt_s: float, torques_nm: Torques) -> None:
        plant = self._plant
        angles_rad, velocities_rad_s = plant.angles_rad, plant.velocities_rad_s
        for index, joint in enumerate(self.joints):
            angle_rad, torque_nm, span = angles_rad[index], torques_nm[index], self._ranges[index]
            joint.add(torque_nm * (angle_rad - self._before_rad[index]))
            joint.peak_speed_rad_s = max(joint.peak_speed_rad_s, abs(velocities_rad_s[index]))
            joint.beyond_rad = max(joint.beyond_rad, angle_rad - span.max_rad, span.min_rad - angle_rad)
            at_stop = abs(angle_rad) > END_STOPS_RAD[index % 2] - AT_STOP_RAD
            if at_stop and abs(torque_nm) > PUSHING_NM and (torque_nm > 0.0) == (angle_rad > 0.0):
                joint.pushed_s += dt_s
        self._before_rad = angles_rad
