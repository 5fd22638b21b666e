"""A dead man's lease: a program that moves the robot promises to be there, and to say so again and again.

A lease is for a moment. Who holds it renews it; whose connection ends, or who does not renew in time, has lost it, and
that stays so until the robot has stopped and its torque is off, where the loop resets the lease: a person arms again.
One program holds it at a time, and as long as it does nobody else moves the robot, so also while torque is off and
hands are in the mud; stopping is everybody's at any time. Whoever has a reason may take the robot over: who held the
lease then stays out until it connects anew, since a program that was overruled must not go on as if nothing had
happened.
"""

from __future__ import annotations

from collections.abc import Hashable
from math import inf

TAKEN_OVER = "taken over: "  # how a refusal begins that holds for as long as the connection


class Lease:
    """Owns who has promised what. A holder is anything that is equal to itself alone and can be named by str()."""

    def __init__(self) -> None:
        self._ousted: dict[Hashable, str] = {}  # and by whom
        self.reset()

    def reset(self) -> None:
        """Nobody holds it, and none is lost. Who was ousted stays out."""
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

    def update(self, now_s: float) -> None:
        """Let a lease that was not renewed in time be lost."""
        self._lost = self.lost(now_s)

    def lost(self, now_s: float) -> bool:
        return self._lost or now_s > self._until_s

    def refusal(self, caller: Hashable, now_s: float, take_over: bool = False) -> str | None:
        """Why `caller` may not move the robot at this moment, or None."""
        if caller in self._ousted:
            return f"{TAKEN_OVER}{self._ousted[caller]} wanted the robot; begin again when it is free"
        if self.lost(now_s):
            return f"{self._holder} has lost the lease: the robot stops; then arm again"
        if self._holder in (None, caller) or take_over:
            return None
        left_s = self._until_s - now_s
        return (
            f"{self._holder} operates the robot: wait until that program has ended, or has been silent for"
            f" {left_s:.1f} s, or overrule it with --take-over; 'mudskipper stop' and 'disarm' are always allowed"
        )

    def renew(self, holder: Hashable, now_s: float, for_s: float) -> str | None:
        """Why it is refused, or None."""
        self.update(now_s)
        refused = self.refusal(holder, now_s)
        if refused is None:
            self._holder, self._until_s = holder, now_s + for_s
        return refused

    def oust(self, by: Hashable) -> None:
        """Nobody holds it any more; who did may not come back."""
        if self.held and by != self._holder:
            self._ousted[self._holder] = str(by)
            self.reset()

    def release(self, holder: Hashable) -> str | None:
        """Why it is refused, or None. A held lease is its holder's; a lost one anybody's who may drive."""
        if self.held and holder != self._holder:
            return f"{self._holder} holds the lease"
        self.reset()
        return None

    def hang_up(self, holder: Hashable) -> None:
        """The connection of `holder` has ended, whoever that is."""
        self._lost = self._lost or holder == self._holder
        self._ousted.pop(holder, None)
