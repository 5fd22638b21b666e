"""The tare of a flipper: the weight of clinging mud, and the offset of the sweep motor.

The authors' logs show 0.4 to 1 N on a flipper in the air after its first extraction, decaying over the strides. So the
tare is measured again in every stride, in free air before the insertion: at the end of the swing and on the way down.
The clinging mud is a weight W in the middle of the wetted part; it loads the joints with -W ∂z/∂q, which changes with
the pose. The sweep joint's zero is an additional constant offset.

The memory fades: a mean over about the last MEMORY distinct samples.
"""

from math import sqrt
from typing import NamedTuple

from control.records import UNKNOWN

CREEP_N = 0.05  # by which the weight may change from the end of the swing to the mud
MEMORY = 40  # samples: a tenth of a second at 380 Hz, half a second with slow messages
FEWEST = 5  # samples of a new zero; with fewer the one before stays


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
        self._reset_mean()

    def _reset_mean(self) -> None:
        self._n = 0
        self._weight = self._square = self._offset = 0.0

    def update(self, rise_sweep_m: float, rise_adduction_m: float, sweep_nm: float, adduction_nm: float) -> None:
        """Add a sample in free air, with the rise of the clinging mud's centre per radian of each joint."""
        weight_n = -adduction_nm / rise_adduction_m
        offset_nm = sweep_nm + weight_n * rise_sweep_m
        self._n += 1
        fraction = 1.0 / min(self._n, MEMORY)
        change_n = weight_n - self._weight
        self._weight += fraction * change_n
        self._square += fraction * (change_n * (weight_n - self._weight) - self._square)
        self._offset += fraction * (offset_nm - self._offset)

    def set_zero(self) -> None:
        """Set the zero to the mean in free air; called before the flipper enters the mud."""
        if self._n >= FEWEST:
            std_error_n = sqrt(max(0.0, self._square) / (min(self._n, MEMORY) - 1))
            self.zero = Zero(self._weight, self._offset, std_error_n)
            self.drift_n = self._weight - self._before_n
            self._before_n = self._weight
        self._reset_mean()

    def correct(self, weight_n: float, std_error_n: float) -> float:
        """Correct the zero by the load seen on the way down, weighted by precision; return the correction."""
        own = self.zero.std_error_n * self.zero.std_error_n + CREEP_N * CREEP_N
        fraction = own / (own + std_error_n * std_error_n)
        self.zero = self.zero._replace(
            weight_n=self.zero.weight_n + fraction * weight_n, std_error_n=sqrt(own * (1.0 - fraction))
        )
        return fraction * weight_n
