"""A linear stage's encoder as a serial port meets it: a serial talker that prints the count of a place.

A counter begins at zero wherever it is when it gets its power.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Annotated

from control.bounds import Bounds
from simulation.devices.serial_device import SerialTalker, TalkerParameters


@dataclass(frozen=True)
class StageEncoderParameters(TalkerParameters):
    burst_s: Annotated[float, Bounds(0.0, 0.2)] = 0.004  # another adapter than the load cell's
    metres_per_count: Annotated[float, Bounds(1e-8, 0.01)] = 1e-5
    label: str = ""


class EmulatedStageEncoder(SerialTalker):
    """Owns which place is its zero. `place_m`, told a time, is where the stage is then."""

    def __init__(
        self, position_m: Callable[[float], float], parameters: StageEncoderParameters, link: Path, seed: int = 1
    ) -> None:
        self.encoder = parameters
        self.position_m = position_m
        self._zero_m: float | None = None
        super().__init__(self._count, parameters, link, Random(seed))

    def plug_in(self) -> None:
        self._zero_m = None
        super().plug_in()

    def _count(self, at_s: float) -> bytes:
        position_m = self.position_m(at_s)
        if self._zero_m is None:
            self._zero_m = position_m
        return f"{self.encoder.label}{round((position_m - self._zero_m) / self.encoder.metres_per_count)}\r\n".encode()
