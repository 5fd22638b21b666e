"""The order of phases that makes a stride, told apart from what is learned in it.

A stride begins with swing, insertion or rest, and is complete when insertion, stance and extraction have followed. It
closes on the first sample of the phase after; one that rest cuts short does not close. Pauses and a recovery lie
between its phases: a flipper that was recovered has its stride closed by the swing that follows.
"""

from __future__ import annotations

from typing import NamedTuple

from control.records import Phase

STROKES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION)
BORDERS = (Phase.SWING, Phase.INSERTION, Phase.REST)


class Change(NamedTuple):
    """What a change of phase brings with it."""

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
        """A stride."""
        self.start_s = self._phase_start_s = now_s
        self.duration_s = {phase: 0.0 for phase in STROKES}

    def change(self, now_s: float, phase: Phase) -> Change:
        """To be called when the phase is another one."""
        ended = self.phase
        if ended in self.duration_s:
            self.duration_s[ended] = now_s - self._phase_start_s
        border = phase in BORDERS
        complete = phase is not Phase.REST and all(duration_s > 0.0 for duration_s in self.duration_s.values())
        self.phase, self._phase_start_s = phase, now_s
        return Change(ended, border, border and complete)
