"""Proves the watchdog of a drive that cannot report it, by a moment of silence while the drive is idle.

The watchdog of ODrive's firmware 0.5 also runs in an idle drive, any frame to the drive feeds it, and the heartbeats
say when it has expired. So the program sends to the drive in every tick until two heartbeats in a row say that it has
not expired, and then sends nothing: the next heartbeats must say that it has. That shows that it is on, and that it
expires at the latest two heartbeats after its time-out; the bench measures the time itself, with torque on. A pause of
this program proves nothing, and neither does a command meanwhile: the proof begins again.
"""

from control.records import NEVER_S, UNKNOWN

LATE_S = 0.05  # a heartbeat; a longer pause of this program
IN_A_ROW = 2  # heartbeats: of the first one it is not known what the drive received before


class WatchdogProof:
    """`silent`: nothing may be sent to the idle drive. `watchdog_s`: the time-out; NaN: not proven yet, 0: off."""

    def __init__(self, timeout_s: float, heartbeat_period_s: float) -> None:
        self._timeout_s = timeout_s
        self._longest_s = timeout_s + 2.0 * heartbeat_period_s + LATE_S
        self.reset()

    def reset(self) -> None:
        self.watchdog_s = UNKNOWN
        self.begin_again()

    def begin_again(self) -> None:
        self.silent = False
        self._silent_since_s = NEVER_S
        self._sound = self._expired = 0  # heartbeats in a row

    @property
    def concluded(self) -> bool:
        return self.watchdog_s == self.watchdog_s

    @property
    def must_clear(self) -> bool:
        """Return whether the watchdog expired earlier: it could not show that it does again.

        The errors of a whole board are cleared. By then its other drive has reported its own.
        """
        return self._expired >= IN_A_ROW

    def on_heartbeat(self, expired: bool, fit: bool, read_s: float, read_before_s: float) -> None:
        """Handle a heartbeat. `fit`: the drive is idle and without other errors, and is to remain so."""
        if self.concluded:
            return
        if not fit or read_s - read_before_s > LATE_S:
            self.begin_again()
        elif self.silent:
            silence_s = read_s - self._silent_since_s
            if expired or silence_s > self._longest_s:
                self.begin_again()
                self.watchdog_s = min(self._timeout_s, silence_s) if expired else 0.0
        else:
            self._sound, self._expired = (0, self._expired + 1) if expired else (self._sound + 1, 0)
            self.silent = self._sound >= IN_A_ROW
            self._silent_since_s = read_before_s  # every tick sends after it has read
