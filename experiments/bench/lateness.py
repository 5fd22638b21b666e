"""How late ticks and messages were while torque was on: what a measurement at the bench may be spoiled by.

A tick that is missed lets every drive go on with the last torque, and a message that is late lets the loop command by
what was: joints then stray from their path, and currents are seen late, though robot and drives may be well. Nothing
tells a drive that is late from a computer on which drives are emulated and that has too much to do.
"""

from __future__ import annotations

from control.rate import PERIOD_S
from control.records import DriveStates
from firmware_host.ticker import Tick

LATE_S = 2.0 * PERIOD_S  # age of a position or a current; drives send theirs more often than the loop ticks
BUSY = "end what else runs on this computer, and give this program real-time priority (docs/how-to/install.md)"
WIRES = "see stage 1, and where the drives are emulated, end what else runs on this computer"


class Lateness:
    """Owns what was late since the last reset."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.ticks = 0  # the missed ones included
        self.missed = 0
        self.oldest_s = 0.0

    def update(self, tick: Tick, states: DriveStates) -> None:
        self.ticks += 1 + tick.missed
        self.missed += tick.missed
        age_s = tick.now_s - min(min(state.angle_stamp_s, state.current_stamp_s) for state in states)
        self.oldest_s = max(self.oldest_s, age_s)

    @property
    def message(self) -> str:
        """Empty where all was in time."""
        reported = []
        if self.missed:
            reported.append(f"this computer missed {self.missed} of {self.ticks} ticks")
        if self.oldest_s > LATE_S:
            reported.append(f"the drives' messages were up to {1e3 * self.oldest_s:.0f} ms old")
        return f"Meanwhile {' and '.join(reported)}: {BUSY if self.missed else WIRES}." if reported else ""
