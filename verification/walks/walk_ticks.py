"""The ticks of a walk by their position in it, and the work of each without the noise of the computer."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from control.records import Phase
from verification.walks.scaled_clock import ScaledWalk

END_TICKS = 60  # of a stance or a swing: the work of the end before it is finished
AFTER = (Phase.STANCE, Phase.SWING)

BeforeTick = Callable[[int, int], None]


class WalkTick(NamedTuple):
    """A tick by its position in the walk, and its work."""

    span: int  # number of the phase in the walk
    number: int  # within the phase
    phase: Phase
    worked_s: float

    @property
    def at_end(self) -> bool:
        """Whether an insertion or a stride has just ended."""
        return self.phase in AFTER and self.number < END_TICKS


def walk_ticks(walk: ScaledWalk, number: int, before_tick: BeforeTick) -> list[WalkTick]:
    """Returns the next ticks; `before_tick` gets the position of each."""
    ticks, span, index, phase = list[WalkTick](), 0, 0, Phase.REST
    for _ in range(number):
        before, phase = phase, walk.loop.controller.target.phase  # that this tick measures
        span, index = (span, index + 1) if phase is before else (span + 1, 0)
        before_tick(span, index)
        walk.step()
        ticks.append(WalkTick(span, index, phase, walk.worked_s))
    return ticks


def least_work(walks: Sequence[Sequence[WalkTick]]) -> list[WalkTick]:
    """Returns the ticks of identical walks, each with its shortest duration. Raises RuntimeError where they differ."""
    if any([tick[:3] for tick in walk] != [tick[:3] for tick in walks[0]] for walk in walks):
        raise RuntimeError("the walks differ: their phases change at different ticks")
    return [same[0]._replace(worked_s=min(tick.worked_s for tick in same)) for same in zip(*walks, strict=True)]
