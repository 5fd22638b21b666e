"""The order of phases that makes a stride, apart from the estimation in it.

A stride begins with swing, insertion or rest, and is complete when insertion, stance and extraction have followed. It
closes on the first sample of the next phase; a stride that rest interrupts does not close. Pauses and a recovery may
lie between its phases: after a recovery the following swing closes the stride.
"""

from typing import NamedTuple

from control.records import Phase

STROKES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION)
BORDERS = (Phase.SWING, Phase.INSERTION, Phase.REST)


class Change(NamedTuple):
    """The result of a change of phase."""

    ended: Phase
    begins_stride: bool
    closes_stride: bool


class StrideClock:
    """Owns phase, durations and the count of strides."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.index = 0
        self.phase = Phase.REST
        self.begin(0.0)

    def begin(self, now_s: float) -> None:
        """Begin a stride."""
        self.start_s = self._phase_start_s = now_s
        self.duration_s = {phase: 0.0 for phase in STROKES}

    def change(self, now_s: float, phase: Phase) -> Change:
        """Record a new phase; called only when the phase differs."""
        ended = self.phase
        if ended in self.duration_s:
            self.duration_s[ended] = now_s - self._phase_start_s
        border = phase in BORDERS
        complete = phase is not Phase.REST and all(duration_s > 0.0 for duration_s in self.duration_s.values())
        self.phase, self._phase_start_s = phase, now_s
        return Change(ended, border, border and complete)
