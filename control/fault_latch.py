"""What is wrong with the robot at this moment, and what was and has not been cleared.

A fault stands from the tick in which it was seen until its cause has been gone for a while. One that met the robot with
torque on stands longer: while torque is on if it asks for a stop, until somebody clears it, or for ever, by its kind.
So the modes see one reaction, that of the worst fault which stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from control.faults import Blocks, Clears, Fault, Reaction
from control.rate import PERIOD_S

GOOD_S = 0.132  # without its cause before a fault is over: 50 ticks


class Standing(NamedTuple):
    fault: Fault  # as last seen
    first_tick: int
    last_tick: int
    latched: bool  # torque was on while it was seen, or it is of a kind for which that is all the same


class FaultLatch:
    """Owns the faults that stand."""

    def __init__(self, period_s: float = PERIOD_S) -> None:
        self._good_ticks = round(GOOD_S / period_s)
        self.reset()

    def reset(self) -> None:
        self._standing: dict[tuple[str, str], Standing] = {}
        self._tick = 0
        self.begun: list[Fault] = []  # in this tick, for the log
        self.over: list[Fault] = []
        self.worst: Fault | None = None

    @property
    def present(self) -> list[Fault]:
        return [standing.fault for standing in self._standing.values()]

    @property
    def reaction(self) -> Reaction:
        return self.worst.kind.reaction if self.worst else Reaction.NONE

    def age_ticks(self, fault: Fault) -> int:
        """Since a fault that stands was seen first."""
        return self._tick - self._standing[fault.name, fault.subject].first_tick

    def blocking(self, forced: bool = False) -> list[Fault]:
        """What stands against arming."""
        least = Blocks.ALWAYS if forced else Blocks.UNLESS_FORCED
        return [fault for fault in self.present if fault.kind.blocks >= least]

    def update(self, present: Sequence[Fault], energised: bool, clearing: bool = False, ticks: int = 1) -> None:
        """Once a tick, with all that is seen in it, `ticks` after the last time."""
        self._tick += ticks
        self.begun, self.over = [], []
        if not present and not self._standing:
            return
        for fault in present:
            self._see(fault, energised)
        for key, standing in list(self._standing.items()):
            if standing.last_tick < self._tick and self._is_over(standing, energised, clearing):
                self.over.append(self._standing.pop(key).fault)
        # Of equals the one that began first.
        self.worst = max(self.present, key=lambda fault: fault.kind.reaction, default=None)

    def _see(self, fault: Fault, energised: bool) -> None:
        key = (fault.name, fault.subject)
        before = self._standing.get(key)
        if before is None:
            self.begun.append(fault)
        self._standing[key] = Standing(
            fault,
            before.first_tick if before else self._tick,
            self._tick,
            energised or fault.kind.latches_idle or (before is not None and before.latched),
        )

    def _is_over(self, standing: Standing, energised: bool, clearing: bool) -> bool:
        fault, _, last_tick, latched = standing
        if latched and fault.kind.clears is Clears.BY_RESTART:
            return False
        if latched and clearing:
            return True
        if latched and fault.kind.clears is Clears.BY_HAND:
            return False
        if latched and energised and fault.kind.reaction >= Reaction.SOFT_STOP:
            return False
        return self._tick - last_tick > self._good_ticks
