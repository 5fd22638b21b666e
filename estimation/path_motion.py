"""Finds insertion, extraction and swing in a path that does all strokes at once, from the motion of the flipper itself.

The strokes of the crutching gait are phases of their own. On any other path the edge goes down and up while the flipper
sweeps; each flipper of an alternating gait is in another part of it. The laws need only the motion: mud resists a plate
that goes down by k_p, one that rises by k_e, and one that sweeps by k_s in all of it.
"""

from math import inf

from control.records import Phase

TURNED_M = 0.0005  # by which the edge must have turned back: more than an encoder's noise
DESCENT_FRACTION = 0.25  # of its height in the air that it has come down in an insertion: more than a rise overshoots


class PathMotion:
    """Owns the part of the path that one flipper is in."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """A path begins above the mud, where a swing of the gait is over."""
        self._part, self._farthest_m, self._descent_fraction = Phase.SWING, inf, 0.0

    def update(self, depth_m: float, is_in_mud: bool) -> Phase:
        """Return the part at this depth of the lower edge."""
        if self._part is Phase.EXTRACTION:
            if not is_in_mud:
                self._begin(Phase.SWING, depth_m)
                self._descent_fraction = DESCENT_FRACTION
        elif self._part is Phase.INSERTION:
            self._farthest_m = max(depth_m, self._farthest_m)
            if depth_m < self._farthest_m - TURNED_M:
                self._begin(Phase.EXTRACTION if is_in_mud else Phase.SWING, depth_m)  # a quick rise bounces in the air
        else:
            self._farthest_m = min(depth_m, self._farthest_m)
            if depth_m > self._farthest_m + max(TURNED_M, -self._descent_fraction * self._farthest_m):
                self._begin(Phase.INSERTION, depth_m)
        return self._part

    def _begin(self, part: Phase, depth_m: float) -> None:
        self._part, self._farthest_m = part, depth_m
