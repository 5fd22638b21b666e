"""Measures how long a joint has been still, by its angle: a drive's velocity estimate is noisy even at rest."""

from math import inf, isfinite, isnan

from control.records import UNKNOWN


class Stillness:
    """Owns the angle about which a joint rests."""

    def __init__(self, band_rad: float) -> None:
        self._band_rad = band_rad
        self.reset()

    def reset(self) -> None:
        self._position_rad = UNKNOWN
        self.still_s = inf  # within the band about that angle; infinite until the joint first moves

    def update(self, angle_rad: float, dt_s: float) -> bool:
        """Return whether the joint is within its band, or reports its first angle."""
        if abs(angle_rad - self._position_rad) <= self._band_rad:
            self.still_s += dt_s
            return True
        first = isnan(self._position_rad) and isfinite(angle_rad)
        self._position_rad = angle_rad
        if not first:
            self.still_s = 0.0
        return first
