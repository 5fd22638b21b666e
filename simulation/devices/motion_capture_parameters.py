"""The rate, noise, latency and drop-outs of the simulated motion capture (simulation/devices/motion_capture.py)."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds


@dataclass(frozen=True)
class MotionCaptureParameters:
    """Motion capture of the body's position; a rate of 0 gives every reader a frame of that time."""

    rate_hz: Annotated[float, Bounds(0.0, 1000.0)] = 0.0
    noise_m: Annotated[float, Bounds(0.0, 0.1)] = 1e-4  # standard deviation, at the scale of this track
    latency_s: Annotated[float, Bounds(0.0, 1.0)] = 0.0
    dropouts_per_s: Annotated[float, Bounds(0.0, 10.0)] = 0.0
    dropout_s: Annotated[float, Bounds(0.001, 10.0)] = 0.2  # mean length


AT_EVERY_TICK = MotionCaptureParameters()
OF_THE_PAPER = MotionCaptureParameters(rate_hz=120.0)
