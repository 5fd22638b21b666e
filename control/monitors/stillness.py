"""For how long a joint has stood still, by its angle: its speed is an estimate with noise, also of a joint at rest."""

from __future__ import annotations

from math import inf, isfinite, isnan

from control.records import UNKNOWN


class Stillness:
    """Owns the place at which a joint was last seen to arrive."""

    def __init__(self, band_rad: float) -> None:
        self._band_rad = band_rad
        self.reset()

    def reset(self) -> None:
        self._position_rad = UNKNOWN
        self.still_s = inf  # within the band about the place; infinite: never seen to leave one

    def update(self, angle_rad: float, dt_s: float) -> bool:
        """Whether the joint is still where it was, or was seen for the first time."""
        if abs(angle_rad - self._position_rad) <= self._band_rad:
            self.still_s += dt_s
            return True
        first = isnan(self._position_rad) and isfinite(angle_rad)
        self._position_rad = angle_rad
        if not first:
            self.still_s = 0.0
        return first
