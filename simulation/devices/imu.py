"""What an inertial measurement unit at the body's centre of mass would tell.

    specific force  R^T (Δv/Δt + g z)     mean over the time since the sample before, g upward at rest
    angular rate    (φ', θ' cos φ, -θ' sin φ)

in the body's axes (x forward, y to the left, z up; see rail_body.py), each with white noise and a bias that is drawn
once. Nothing reads these samples yet: no bus carries them and no driver knows them.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.joint_pd import GRAVITY_M_S2
from simulation.body.carriage import Vector
from simulation.body.free_body import axes_of
from simulation.body.rail_body import BodyMotion


@dataclass(frozen=True)
class ImuParameters:
    rate_hz: Annotated[float, Bounds(1.0, 1000.0)] = 200.0
    force_noise_m_s2: Annotated[float, Bounds(0.0, 10.0)] = 0.0  # standard deviations, of each axis
    force_bias_m_s2: Annotated[float, Bounds(0.0, 10.0)] = 0.0
    rate_noise_rad_s: Annotated[float, Bounds(0.0, 1.0)] = 0.0
    rate_bias_rad_s: Annotated[float, Bounds(0.0, 1.0)] = 0.0


class ImuSample(NamedTuple):
    stamp_s: float
    specific_force_m_s2: Vector
    angular_rate_rad_s: Vector


class Imu:
    """Owns its biases and the motion at its last sample."""

    def __init__(self, parameters: ImuParameters, seed: int = 1) -> None:
        self.parameters = parameters
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        self._random = Random(self._seed)
        none = (0.0, 0.0, 0.0)
        self._force_bias_m_s2 = self._noisy(none, self.parameters.force_bias_m_s2)
        self._rate_bias_rad_s = self._noisy(none, self.parameters.rate_bias_rad_s)
        self._before: tuple[float, Vector] | None = None

    def update(self, now_s: float, motion: BodyMotion) -> ImuSample | None:
        """The sample that is due, if one is. The first motion only begins the first interval."""
        if self._before is None:
            self._before = (now_s, motion.velocity_m_s)
            return None
        elapsed_s = now_s - self._before[0]
        if elapsed_s * self.parameters.rate_hz < 1.0 - 1e-6:  # sums of periods are not exact
            return None
        ahead, aside, upward = (
            (after - before) / elapsed_s for after, before in zip(motion.velocity_m_s, self._before[1], strict=True)
        )
        self._before = (now_s, motion.velocity_m_s)
        return self._sample(now_s, motion, (ahead, aside, upward + GRAVITY_M_S2))

    def _sample(self, now_s: float, motion: BodyMotion, force_m_s2: Vector) -> ImuSample:
        """`force_m_s2`: in the world."""
        forward, across, up = axes_of(motion.roll_rad, motion.pitch_rad)
        ahead, aside, upward = force_m_s2
        x, y, z = (
            ahead * forward[axis] + aside * across[axis] + upward * up[axis] + self._force_bias_m_s2[axis]
            for axis in range(3)
        )
        p, q, r = (
            motion.roll_rad_s * (axis == 0) + motion.pitch_rad_s * across[axis] + self._rate_bias_rad_s[axis]
            for axis in range(3)
        )
        force = self._noisy((x, y, z), self.parameters.force_noise_m_s2)
        return ImuSample(now_s, force, self._noisy((p, q, r), self.parameters.rate_noise_rad_s))

    def _noisy(self, vector: Vector, deviation: float) -> Vector:
        x, y, z = (part + self._random.gauss(0.0, deviation) for part in vector)
        return x, y, z
