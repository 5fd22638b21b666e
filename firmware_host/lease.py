"""A dead man's lease: a program that moves the robot promises to be there, and to say so again and again.

A lease is for a moment. Who holds it renews it; whose connection ends, or who does not renew in time, has lost it, and
that stays so until a person with the right to drive ends it. One program holds it at a time.
"""

from __future__ import annotations

from collections.abc import Hashable
from math import inf

SHORTEST_S, LONGEST_S = 0.1, 10.0  # of what may be promised


class Lease:
    """Owns who has promised what. A holder is anything that is equal to itself alone and can be named by str()."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Nobody holds it, and none is lost."""
        self._holder: Hashable | None = None
        self._until_s = inf
        self._lost = False

    @property
    def holder(self) -> Hashable | None:
        """Also the one who lost it."""
        return self._holder

    @property
    def held(self) -> bool:
        """Or held until just now: `lost` is what tells."""
        return self._holder is not None and not self._lost

    def lost(self, now_s: float) -> bool:
        self._lost = self._lost or now_s > self._until_s
        return self._lost

    def renew(self, holder: Hashable, now_s: float, for_s: float) -> str | None:
        """Why it is refused, or None."""
        if self.lost(now_s):
            return f"{self._holder} has lost the lease: 'mudskipper clear' or 'mudskipper disarm' ends that"
        if self.held and holder != self._holder:
            return f"{self._holder} holds the lease"
        self._holder, self._until_s = holder, now_s + for_s
        return None

    def release(self, holder: Hashable) -> str | None:
        """Why it is refused, or None. A held lease is its holder's; a lost one anybody's who may drive."""
        if self.held and holder != self._holder:
            return f"{self._holder} holds the lease"
        self.reset()
        return None

    def hang_up(self, holder: Hashable) -> None:
        """The connection of `holder` has ended, whoever that is."""
        self._lost = self._lost or holder == self._holder
