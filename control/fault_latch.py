"""Decides how long a fault is present.

A fault is present from the tick in which it is detected until its cause has been gone for a while. A fault that occurs
while torque is on is latched: it stays at least until torque is off if its reaction is a stop, and depending on its
kind until an operator clears it or the daemon restarts. The modes see only the reaction of the worst present fault.
"""

from collections.abc import Sequence
from typing import NamedTuple

from control.faults import Blocks, Clears, Fault, Reaction
from control.rate import PERIOD_S

GOOD_S = 0.132  # without its cause before a fault is over: 50 ticks


class PresentFault(NamedTuple):
    fault: Fault  # with the values of its last detection
    first_tick: int
    last_tick: int
    latched: bool  # it occurred while torque was on, or its kind always latches


class FaultLatch:
    """Owns the present faults."""

    def __init__(self, period_s: float = PERIOD_S) -> None:
        self._good_ticks = round(GOOD_S / period_s)
        self.reset()

    def reset(self) -> None:
        self._present: dict[tuple[str, str], PresentFault] = {}
        self._tick = 0
        self.begun: list[Fault] = []  # in this tick, for the log
        self.over: list[Fault] = []
        self.worst: Fault | None = None

    @property
    def present(self) -> list[Fault]:
        return [each.fault for each in self._present.values()]

    @property
    def reaction(self) -> Reaction:
        return self.worst.kind.reaction if self.worst else Reaction.NONE

    def age_ticks(self, fault: Fault) -> int:
        """Ticks since a present fault was detected first."""
        return self._tick - self._present[fault.name, fault.subject].first_tick

    def blocking(self, forced: str = "") -> list[Fault]:
        """The present faults that block arming; `forced`: names of kinds that an operator overrules, with commas."""
        if not self._present:
            return []
        overruled = forced.split(",")
        return [
            fault
            for fault, *_ in self._present.values()
            if fault.kind.blocks is Blocks.ALWAYS
            or fault.kind.blocks is Blocks.UNLESS_FORCED
            and fault.name not in overruled
        ]

    def update(self, present: Sequence[Fault], energised: bool, clearing: bool = False, ticks: int = 1) -> None:
        """Take in all faults that this tick detects, `ticks` after the last update."""
        self._tick += ticks
        self.begun, self.over = [], []
        if not present and not self._present:
            return
        for fault in present:
            self._detect(fault, energised)
        for key, each in list(self._present.items()):
            if each.last_tick < self._tick and self._is_over(each, energised, clearing):
                self.over.append(self._present.pop(key).fault)
        # Of equal reactions the fault that began first counts.
        self.worst = max(self.present, key=lambda fault: fault.kind.reaction, default=None)

    def _detect(self, fault: Fault, energised: bool) -> None:
        key = (fault.name, fault.subject)
        before = self._present.get(key)
        if before is None:
            self.begun.append(fault)
        self._present[key] = PresentFault(
            fault=fault,
            first_tick=before.first_tick if before else self._tick,
            last_tick=self._tick,
            latched=energised or fault.kind.latches_idle or (before is not None and before.latched),
        )

    def _is_over(self, each: PresentFault, energised: bool, clearing: bool) -> bool:
        fault, _, last_tick, latched = each
        if latched and fault.kind.clears is Clears.BY_RESTART:
            return False
        if latched and clearing:
            return True
        if latched and fault.kind.clears is Clears.BY_HAND:
            return False
        if latched and energised and fault.kind.reaction >= Reaction.SOFT_STOP:
            return False
        return self._tick - last_tick > self._good_ticks
