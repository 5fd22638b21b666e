"""Motion capture of the body's place: frames at a rate, with noise, that arrive late and at times not at all.

A frame tells where the body was when it was exposed. Drop-outs are bursts, as when a marker is hidden: they begin at
random, so many in a second on average, and their lengths are distributed exponentially. At a rate of 0 whoever asks
gets a frame of that moment.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from random import Random
from typing import Annotated, NamedTuple

from control.bounds import Bounds
from control.records import NEVER_S, BodyPose
from drivers.pose.pose_port import NO_SOURCE, STALE_S, PoseReport
from simulation.body.plant import Plant


@dataclass(frozen=True)
class MotionCaptureParameters:
    rate_hz: Annotated[float, Bounds(0.0, 1000.0)] = 0.0
    noise_m: Annotated[float, Bounds(0.0, 0.1)] = 1e-4  # standard deviation, at the scale of this track
    latency_s: Annotated[float, Bounds(0.0, 1.0)] = 0.0
    dropouts_per_s: Annotated[float, Bounds(0.0, 10.0)] = 0.0
    dropout_s: Annotated[float, Bounds(0.001, 10.0)] = 0.2  # mean length


AT_EVERY_TICK = MotionCaptureParameters()
OF_THE_PAPER = MotionCaptureParameters(rate_hz=120.0)


class CameraFrame(NamedTuple):
    exposed_s: float
    x_m: float


class MotionCapture:
    """Owns the frames under way and the drop-out that is going on."""

    def __init__(self, parameters: MotionCaptureParameters, seed: int) -> None:
        self.parameters = parameters
        self._period_s = 1.0 / parameters.rate_hz if parameters.rate_hz else 0.0
        self._seed = seed
        self.reset()

    def reset(self) -> None:
        self._random = Random(self._seed)
        self._due_s = self._exposed_s = NEVER_S
        self._hidden_until_s = NEVER_S
        self._under_way: deque[CameraFrame] = deque()

    def step(self, now_s: float, plant: Plant) -> Iterator[CameraFrame]:
        """The frames that arrive by now. Called seldom, it misses exposures, as a camera does that is held up."""
        if now_s >= self._due_s:
            self._expose(now_s, plant)
        while self._under_way and self._under_way[0].exposed_s + self.parameters.latency_s <= now_s:
            yield self._under_way.popleft()

    def _expose(self, now_s: float, plant: Plant) -> None:
        """Exposures lie on a grid of time, the body's place there on the line that it moves along now."""
        period_s = self._period_s
        exposed_s = self._due_s if now_s - self._due_s < period_s else now_s
        self._due_s = exposed_s + period_s
        x_m = plant.body_m - plant.body_m_s * (now_s - exposed_s)
        if not self._is_hidden(exposed_s):
            noise_m = self.parameters.noise_m
            x_m += self._random.gauss(0.0, noise_m) if noise_m else 0.0
            self._under_way.append(CameraFrame(exposed_s, x_m))
        self._exposed_s = exposed_s

    def _is_hidden(self, exposed_s: float) -> bool:
        parameters, elapsed_s = self.parameters, exposed_s - self._exposed_s
        if not parameters.dropouts_per_s or elapsed_s == inf:
            return False
        if exposed_s >= self._hidden_until_s and self._random.random() < parameters.dropouts_per_s * elapsed_s:
            self._hidden_until_s = exposed_s + self._random.expovariate(1.0 / parameters.dropout_s)
        return exposed_s < self._hidden_until_s


class SimulatedPose:
    """A PoseSource: the newest frame that has arrived, stamped when it was read, as a pose port keeps it."""

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
