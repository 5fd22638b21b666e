"""The serial instruments of the load-cell test rig: the load cell's amplifier, and the linear stage's encoder.

Both print lines on a pseudo-terminal. The amplifier's converter integrates over its period, adds noise and drift,
rounds to a step of its own, and stops at its range. The encoder's counter starts at zero wherever it gets its power.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import fsum
from pathlib import Path
from random import Random

from simulation.devices.serial_device import SerialTalker, TalkerParameters

LARGEST_COUNT = 2**23


@dataclass(frozen=True)
class AmplifierParameters(TalkerParameters):
    rate_hz: float = 80.0  # of an HX711 with its rate pin high; 10 with it low
    style: str = "counts"  # or indicator, columns
    counts_per_newton: float = 42000.0  # a cell of 20 N, 2 mV/V, and gain 128
    zero_counts: float = 81000.0
    noise_n: float = 0.008  # of the mounted cell: the stage shakes more than the chip
    drift_n_s: float = 0.0
    averaged: int = 1  # conversions in the mean that an indicator's filter prints
    range_n: float = 20.0  # beyond it the cell is overloaded


class EmulatedAmplifier(SerialTalker):
    """Owns the time at which it was switched on.

    `mean_force_n(time)` returns the mean force on the cell since the last conversion.
    """

    def __init__(
        self, mean_force_n: Callable[[float], float], parameters: AmplifierParameters, link: Path, seed: int = 1
    ) -> None:
        self.mean_force_n = mean_force_n
        self.amplifier = parameters
        self._noise_of_cell = Random(seed)
        self._started_s: float | None = None
        self._converted_n: deque[float] = deque(maxlen=parameters.averaged)
        super().__init__(self._convert, parameters, link, Random(seed))

    def _convert(self, at_s: float) -> bytes:
        if self._started_s is None:
            self._started_s = at_s
        force_n = self.mean_force_n(at_s) + self._noise_of_cell.gauss(0.0, self.amplifier.noise_n)
        force_n += self.amplifier.drift_n_s * (at_s - self._started_s)
        self._converted_n.append(force_n)
        return self._line(fsum(self._converted_n) / len(self._converted_n), at_s)

    def _line(self, force_n: float, at_s: float) -> bytes:
        amplifier = self.amplifier
        overloaded = abs(force_n) > amplifier.range_n
        if amplifier.style == "indicator":
            return b"OL,GS,+-------kg\r\n" if overloaded else f"ST,GS,{force_n / 9.80665:+09.5f}kg\r\n".encode()
        counts = round(amplifier.zero_counts + amplifier.counts_per_newton * force_n)
        if overloaded:
            counts = LARGEST_COUNT if force_n * amplifier.counts_per_newton > 0.0 else -LARGEST_COUNT
        counts = max(-LARGEST_COUNT, min(counts, LARGEST_COUNT - 1))
        return (
            f"{round(1000 * at_s)},{counts}\r\n".encode() if amplifier.style == "columns" else f"{counts}\r\n".encode()
        )


@dataclass(frozen=True)
class StageEncoderParameters(TalkerParameters):
    burst_s: float = 0.004  # another adapter than the load cell's
    metres_per_count: float = 1e-5
    label: str = ""


class EmulatedStageEncoder(SerialTalker):
    """Owns its zero. `position_m(time)` returns the stage's position."""

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
