"""Motion capture of the body's position: frames at a rate, with noise, latency and drop-outs.

A frame reports the body's position at its exposure. Drop-outs are bursts, as of a hidden marker: they begin at random,
a given number per second on average, and their lengths are distributed exponentially. At a rate of 0 every reader gets
a frame of that time.
"""

from collections import deque
from collections.abc import Iterator
from math import inf
from random import Random
from typing import NamedTuple

from control.records import NEVER_S, BodyPose
from drivers.pose.pose_port import NO_SOURCE, STALE_S, PoseReport
from simulation.body.plant import Plant
from simulation.devices.motion_capture_parameters import MotionCaptureParameters


class CameraFrame(NamedTuple):
    exposed_s: float
    x_m: float


class MotionCapture:
    """Owns the frames in transit and the current drop-out."""

    def __init__(self, parameters: MotionCaptureParameters, seed: int) -> None:
        self.parameters = parameters
        self._period_s = 1.0 / parameters.rate_hz if parameters.rate_hz else 0.0
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        self._random = Random(self._seed)
        self._due_s = self._exposed_s = NEVER_S
        self._hidden_until_s = NEVER_S
        self._in_transit: deque[CameraFrame] = deque()

    def step(self, now_s: float, plant: Plant) -> Iterator[CameraFrame]:
        """Yield the frames that arrive by now. Infrequent calls miss exposures, as a delayed camera does."""
        if now_s >= self._due_s:
            self._expose(now_s, plant)
        while self._in_transit and self._in_transit[0].exposed_s + self.parameters.latency_s <= now_s:
            yield self._in_transit.popleft()

    def _expose(self, now_s: float, plant: Plant) -> None:
        """Add a frame. Exposures lie on a grid of time, at which the position is extrapolated."""
        period_s = self._period_s
        exposed_s = self._due_s if now_s - self._due_s < period_s else now_s
        self._due_s = exposed_s + period_s
        x_m = plant.body_m - plant.body_m_s * (now_s - exposed_s)
        if not self._is_hidden(exposed_s):
            noise_m = self.parameters.noise_m
            x_m += self._random.gauss(0.0, noise_m) if noise_m else 0.0
            self._in_transit.append(CameraFrame(exposed_s, x_m))
        self._exposed_s = exposed_s

    def _is_hidden(self, exposed_s: float) -> bool:
        parameters, elapsed_s = self.parameters, exposed_s - self._exposed_s
        if not parameters.dropouts_per_s or elapsed_s == inf:
            return False
        if exposed_s >= self._hidden_until_s and self._random.random() < parameters.dropouts_per_s * elapsed_s:
            self._hidden_until_s = exposed_s + self._random.expovariate(1.0 / parameters.dropout_s)
        return exposed_s < self._hidden_until_s


class SimulatedPose:
    """A PoseSource that returns the newest frame that has arrived, stamped when it was read, as a pose port does."""

    def __init__(self, plant: Plant, parameters: MotionCaptureParameters, seed: int) -> None:
        self._plant = plant
        self._capture = MotionCapture(parameters, seed)
        self._pose = BodyPose()

    def read(self, now_s: float) -> BodyPose:
        for frame in self._capture.step(now_s, self._plant):
            self._pose = BodyPose(now_s, frame.x_m)
        return self._pose if now_s - self._pose.stamp_s <= STALE_S else BodyPose()

    def report(self) -> PoseReport:
        return NO_SOURCE
