"""Work that takes longer than a tick allows, as a generator: each `yield` ends a unit that is short enough.

The work at the end of an insertion and at the close of a stride takes up to twelve times as long as a tick. The loop
runs one unit of it a tick, after the command of that tick. The units run in a fixed order on values that were measured
before the work began, so the result is the same however many of them share a tick. There are no threads: a unit is
never interrupted.
"""

from collections import deque
from collections.abc import Generator, Iterator, Sequence
from typing import TypeVar

Result = TypeVar("Result")
Value = TypeVar("Value")
Work = Generator[None, None, Result]
DONE = object()


def finish(work: Work[Result]) -> Result:
    """Run all units of the work and return its result."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: Result = end.value
            return result


def finished(result: Result) -> Work[Result]:
    """Return work whose result is known already."""
    yield from ()
    return result


def batched(values: Sequence[Value], size: int) -> Iterator[Sequence[Value]]:
    """Yield `size` values at a time, and the rest at the end, as itertools.batched from Python 3.12 on."""
    for start in range(0, len(values), size):
        yield values[start : start + size]


class WorkQueue:
    """Owns the work that is not finished, and runs it in the order in which it was added."""

    def __init__(self) -> None:
        self._waiting: deque[Work[None]] = deque()

    @property
    def is_empty(self) -> bool:
        return not self._waiting

    def add(self, work: Work[None]) -> None:
        self._waiting.append(work)

    def run(self, units: int) -> None:
        """Run this many units, or all if there are fewer."""
        while self._waiting and units > 0:
            units -= 1
            if next(self._waiting[0], DONE) is DONE:
                self._waiting.popleft()

    def finish(self) -> None:
        """Run all units that are left."""
        while self._waiting:
            finish(self._waiting.popleft())

    def clear(self) -> None:
        """Drop the work that is not finished."""
        self._waiting.clear()
