"""The dead-man lease: a program that moves the robot must renew it, or the robot stops.

The lease is lost if its holder disconnects or does not renew it in time. It stays lost until its holder releases it, or
until the robot has stopped and its torque is off: then the loop resets it, and the robot can be armed again. One
program holds the lease at a time. Meanwhile no other program moves the robot, also while torque is off and hands may be
in the mud; every user may still stop it. An operator may take the robot over. The previous holder is then refused until
it connects again, since a program that was overruled must not continue as if nothing had happened.
"""

from collections.abc import Hashable
from math import inf

ALWAYS_ALLOWED = "'mudskipper stop' and 'disarm' are always allowed"
TAKEN_OVER = "taken over: "  # prefix of a refusal that lasts as long as the connection


class Lease:
    """Owns the holder of the lease; any hashable object can hold it, and str() names it in messages."""

    def __init__(self) -> None:
        self._ousted: dict[Hashable, str] = {}  # previous holders, and who took the robot over
        self.reset()

    def reset(self) -> None:
        """Free the lease; programs that were overruled stay refused."""
        self.holder: Hashable | None = None  # also after it has lost the lease
        self.until_s = inf  # unless it is renewed; infinite if no program has taken the lease
        self._lost = False

    @property
    def held(self) -> bool:
        """Return whether the lease is held, as of the last `update`."""
        return self.holder is not None and not self._lost

    def update(self, now_s: float) -> None:
        """Let a lease that was not renewed in time be lost."""
        self._lost = self.lost(now_s)

    def lost(self, now_s: float) -> bool:
        return self._lost or now_s > self.until_s

    def refusal(self, caller: Hashable, now_s: float, take_over: bool = False) -> str | None:
        """Return why `caller` may not move the robot now, or None."""
        if caller in self._ousted:
            return f"{TAKEN_OVER}{self._ousted[caller]} wanted the robot; begin again when it is free"
        if self.lost(now_s):
            return f"{self.holder} has lost the lease: the robot stops; then arm again"
        if self.holder in (None, caller) or take_over:
            return None
        left_s = self.until_s - now_s
        return (
            f"{self.holder} operates the robot: wait until that program has ended, or has been silent for"
            f" {left_s:.1f} s, or overrule it with --take-over; {ALWAYS_ALLOWED}"
        )

    def renew(self, holder: Hashable, now_s: float, for_s: float) -> str | None:
        """Take or renew the lease; return why this is refused, or None."""
        self.update(now_s)
        refused = self.refusal(holder, now_s)
        if refused is None:
            self.holder, self.until_s = holder, now_s + for_s
        return refused

    def oust(self, by: Hashable) -> None:
        """Take the lease away from its holder, which stays refused until it connects again."""
        if self.held and by != self.holder:
            self._ousted[self.holder] = str(by)
            self.reset()

    def release(self, holder: Hashable) -> str | None:
        """Free the lease; return why this is refused, or None.

        No other program frees a lost lease: the loop would then not see that it was lost, and the robot would move on.
        """
        if self.holder not in (None, holder):
            return f"{self.holder} {'has lost' if self._lost else 'holds'} the lease"
        self.reset()
        return None

    def hang_up(self, holder: Hashable) -> None:
        """Handle the end of a connection."""
        self._lost = self._lost or holder == self.holder
        self._ousted.pop(holder, None)
