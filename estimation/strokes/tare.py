"""The zero of a flipper's loads: mud that clings to it, and what offsets the motors have.

The authors' logs show 0.4 to 1 N on a flipper that hangs in the air after its first extraction, decaying over the
strides (section 1.6 of the physics). So the zero is taken anew in every stride, from the free air before the insertion:
the tail of the swing and the way down to the mud. What clings is a weight W in the middle of what was in the mud; it
turns the joints by -W ∂z/∂q, which changes with the pose. The sweep joint's zero is a constant offset on top.

The memory fades: a mean over the last MEMORY distinct samples or so.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from control.records import UNKNOWN

CREEP_N = 0.05  # by which the weight may have changed from the swing's tail to the mud
MEMORY = 40  # samples: a tenth of a second at 380 Hz, half a second where messages are slow
FEWEST = 5  # samples that tell a zero; with less the one before stays


class Zero(NamedTuple):
    weight_n: float = 0.0  # downward
    sweep_offset_nm: float = 0.0
    std_error_n: float = 0.0  # of the weight


class Tare:
    """Owns the zero of one flipper."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.zero = Zero()
        self.drift_n = UNKNOWN
        self._before_n = UNKNOWN
        self._begin()

    def _begin(self) -> None:
        self._n = 0
        self._weight = self._square = self._offset = 0.0

    def update(self, rise_sweep_m: float, rise_adduction_m: float, sweep_nm: float, adduction_nm: float) -> None:
        """One sample in free air; the rise of where the mud clings, per radian of the joints."""
        weight_n = -adduction_nm / rise_adduction_m
        offset_nm = sweep_nm + weight_n * rise_sweep_m
        self._n += 1
        fraction = 1.0 / min(self._n, MEMORY)
        change_n = weight_n - self._weight
        self._weight += fraction * change_n
        self._square += fraction * (change_n * (weight_n - self._weight) - self._square)
        self._offset += fraction * (offset_nm - self._offset)

    def take(self) -> None:
        """Before the flipper enters the mud: from here on the zero is what the air told."""
        if self._n >= FEWEST:
            std_error_n = sqrt(max(0.0, self._square) / (min(self._n, MEMORY) - 1))
            self.zero = Zero(self._weight, self._offset, std_error_n)
            self.drift_n = self._weight - self._before_n
            self._before_n = self._weight
        self._begin()

    def correct(self, weight_n: float, std_error_n: float) -> float:
        """By what the way down to the mud still showed, weighed against the zero; returns what it is corrected by."""
        own = self.zero.std_error_n * self.zero.std_error_n + CREEP_N * CREEP_N
        fraction = own / (own + std_error_n * std_error_n)
        self.zero = self.zero._replace(
            weight_n=self.zero.weight_n + fraction * weight_n, std_error_n=sqrt(own * (1.0 - fraction))
        )
        return fraction * weight_n
