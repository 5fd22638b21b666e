"""Stops the daemon's process as SIGSTOP does: between two ticks, or inside of one, before it calls a part of the loop.

The drives and the mechanics go on meanwhile. A tick that was stopped continues as if nothing had happened, with the
values that it has read before, except that the clock has moved on.
"""

from collections.abc import Callable
from typing import Any

from tests.dst.scenario import Suspend
from verification.faults.failing_robot import FailingRobot


class Suspension:
    """Owns a request to stop the robot's daemon in its next tick."""

    def __init__(self, lockstep: FailingRobot) -> None:
        self._lockstep = lockstep
        self._ticks = 0  # that the next tick is stopped for

    def begin(self, event: Suspend) -> None:
        """Stop the daemon once: now, or in the next tick that gets to the place."""
        ticks = max(1, round(event.for_s / self._lockstep.period_s))
        if not event.inside:
            self._lockstep.stall(ticks)
            return
        owner, name = self._place(event.inside)
        true_method: Callable[..., Any] = getattr(owner, name)
        setattr(owner, name, lambda *given, **named: self._stopped(owner, name, ticks, true_method, given, named))

    def _place(self, inside: str) -> tuple[Any, str]:
        loop = self._lockstep.loop
        if inside.startswith("bus."):
            return loop.drives.ports[inside.removeprefix("bus.")], "send"
        part, _, name = inside.partition(".")
        return getattr(loop, part), name

    def _stopped(
        self, owner: Any, name: str, ticks: int, method: Callable[..., Any], given: Any, named: dict[str, Any]
    ) -> Any:
        """Let the robot go on without the loop, then continue the call."""
        vars(owner).pop(name, None)
        self._ticks += ticks
        lockstep = self._lockstep
        lockstep.stall(lockstep.late_ticks + ticks)
        later_s = lockstep.now_s + self._ticks * lockstep.period_s
        lockstep.robot.advance(later_s)
        lockstep.loop._clock = lambda: later_s
        return method(*given, **named)

    def step(self) -> None:
        """Run one step of the robot. Within a stopped tick only, its clock is ahead of the tick."""
        self._lockstep.step()
        if self._ticks:
            self._ticks = 0
            self._lockstep.loop._clock = self._lockstep._now_s
