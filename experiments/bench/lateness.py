"""Counts late ticks and messages while torque is on, because they can invalidate a measurement at the bench.

In a missed tick every drive holds its last torque, and after a late message the loop commands from old states: joints
leave their path and currents appear late, although robot and drives may be in order. A late drive cannot be
distinguished from an overloaded computer that emulates drives.
"""

from dataclasses import dataclass

from control.rate import PERIOD_S
from control.records import DriveStates
from firmware_host.ticker import Tick

LATE_S = 2.0 * PERIOD_S  # age of a position or a current; drives send theirs more often than the loop ticks
BUSY = "end what else runs on this computer, and give this program real-time priority (docs/how-to/install.md)"
WIRES = "see stage 1, and where the drives are emulated, end what else runs on this computer"


@dataclass
class Lateness:
    """Owns what was late."""

    ticks: int = 0  # including the missed ones
    missed: int = 0
    oldest_s: float = 0.0

    def update(self, tick: Tick, states: DriveStates) -> None:
        self.ticks += 1 + tick.missed
        self.missed += tick.missed
        age_s = tick.now_s - min(min(state.angle_stamp_s, state.current_stamp_s) for state in states)
        self.oldest_s = max(self.oldest_s, age_s)

    @property
    def message(self) -> str:
        """Describe the lateness; empty without any."""
        reported = []
        if self.missed:
            reported.append(f"this computer missed {self.missed} of {self.ticks} ticks")
        if self.oldest_s > LATE_S:
            reported.append(f"the drives' messages were up to {1e3 * self.oldest_s:.0f} ms old")
        return f"Meanwhile {' and '.join(reported)}: {BUSY if self.missed else WIRES}." if reported else ""
