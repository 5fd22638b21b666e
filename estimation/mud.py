"""The estimator that the loop, the replay and the simulator's tests share: both flippers, one sample a tick.

It sees angles, currents, the gait's phase and the body's place, and nothing else: no bus, no clock. The same samples
give the same numbers to the last digit, live or from a log.
"""

from __future__ import annotations

from typing import NamedTuple

from control.geometry import FlipperGeometry
from control.joint_pd import ArmMass
from control.records import NO_LOAD, FlipperLoad, JointAngles, Phase, StrideEstimate
from estimation.stride import FlipperEstimator

JointVelocities = tuple[float, float, float, float]  # rad/s, in the order of JOINTS
Currents = tuple[float, float, float, float]  # A, in the order of JOINTS


class MudReading(NamedTuple):
    left: FlipperLoad = NO_LOAD
    right: FlipperLoad = NO_LOAD
    strides: tuple[StrideEstimate, ...] = ()  # closed by this sample


class MudEstimator:
    def __init__(
        self, geometry: FlipperGeometry, mass: ArmMass, torque_constants_nm_a: tuple[float, float, float, float]
    ) -> None:
        a, b, c, d = torque_constants_nm_a
        self.left = FlipperEstimator("left", geometry, mass, a, b)
        self.right = FlipperEstimator("right", geometry, mass, c, d)

    def reset(self) -> None:
        self.left.reset()
        self.right.reset()

    def update(
        self,
        now_s: float,
        phase: Phase,
        angles_rad: JointAngles,
        velocities_rad_s: JointVelocities,
        currents_a: Currents,
        body_x_m: float,
    ) -> MudReading:
        """One sample of everything, in the order of JOINTS; what is not known is NaN."""
        a1, a2, a3, a4 = angles_rad
        v1, v2, v3, v4 = velocities_rad_s
        i1, i2, i3, i4 = currents_a
        left, left_stride = self.left.update(now_s, phase, a1, a2, v1, v2, i1, i2, body_x_m)
        right, right_stride = self.right.update(now_s, phase, a3, a4, v3, v4, i3, i4, body_x_m)
        if left_stride is None and right_stride is None:
            return MudReading(left, right)
        strides = tuple(stride for stride in (left_stride, right_stride) if stride is not None)
        return MudReading(left, right, strides)
