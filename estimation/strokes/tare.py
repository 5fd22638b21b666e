"""The tare of a flipper: the weight of clinging mud.

The authors' logs show 0.4 to 1 N on a flipper in the air after its first extraction, decaying over the strides. So the
tare is measured again in every stride, in free air before the insertion: at the end of the swing and on the way down.
The clinging mud is a weight W in the middle of the wetted part; it loads the joints with -W ∂z/∂q, which changes with
the pose. Part of it falls off on the way down: in one log 1.28 N at the end of the swing are 0.46 N just above the mud.

The memory fades: a mean over about the last MEMORY distinct samples.
"""

from math import hypot, isfinite, sqrt
from typing import NamedTuple

from control.records import UNKNOWN

CREEP_N = 0.05  # by which the weight may change from the end of the swing to the mud
SHAKEN_FRACTION = 0.4  # of the weight, which may fall off on the way down
MEMORY = 40  # samples: a tenth of a second at 380 Hz, half a second with slow messages
UNSEEN_N = 0.5  # by which it may change over a swing that is not in the air; its size before any air is seen
FEWEST = 5  # samples of a new zero; with fewer the one before stays


class Zero(NamedTuple):
    weight_n: float = 0.0  # downward
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
        self._weight = self._square = 0.0

    def update(self, rise_clinging_m: float, adduction_nm: float) -> None:
        """Add a sample in free air, with the rise of the clinging mud's centre per radian of adduction."""
        weight_n = -adduction_nm / rise_clinging_m
        self._n += 1
        fraction = 1.0 / min(self._n, MEMORY)
        change_n = weight_n - self._weight
        self._weight += fraction * change_n
        self._square += fraction * (change_n * (weight_n - self._weight) - self._square)

    def set_zero(self, is_air: bool = True) -> None:
        """Set the zero to the mean of a swing in free air; called before the flipper enters the mud."""
        if self._n >= FEWEST and is_air:
            std_error_n = sqrt(max(0.0, self._square) / (min(self._n, MEMORY) - 1))
            self.zero = Zero(self._weight, std_error_n)
            self.drift_n = self._weight - self._before_n
            self._before_n = self._weight
        elif not is_air or not isfinite(self._before_n):
            self.zero = self.zero._replace(std_error_n=hypot(self.zero.std_error_n, UNSEEN_N))
        self._reset_mean()

    def correct(self, weight_n: float, std_error_n: float) -> float:
        """Correct the zero by the load seen on the way down, weighted by precision; return the correction."""
        shaken_n = SHAKEN_FRACTION * self.zero.weight_n
        own = self.zero.std_error_n * self.zero.std_error_n + CREEP_N * CREEP_N + shaken_n * shaken_n
        fraction = own / (own + std_error_n * std_error_n)
        self.zero = self.zero._replace(
            weight_n=self.zero.weight_n + fraction * weight_n, std_error_n=sqrt(own * (1.0 - fraction))
        )
        return fraction * weight_n
