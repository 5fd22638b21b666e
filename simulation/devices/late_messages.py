"""Messages that arrive late, by evenly drawn times, and in order: none overtakes another."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from random import Random

from drivers.can.frames import Frame


class LateMessages:
    """Owns what is under way."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self.reset()

    def reset(self) -> None:
        self._under_way: deque[tuple[float, Frame]] = deque()  # when it arrives, and what

    def update(self, frames: Iterable[Frame], now_s: float, longest_s: float) -> Iterator[Frame]:
        """What arrives by now, after `longest_s` at the most. Stamps tell when, as a receiver's do."""
        for frame in frames:
            arrival_s = now_s + longest_s * self._random.random()
            if self._under_way:
                arrival_s = max(arrival_s, self._under_way[-1][0])
            self._under_way.append((arrival_s, frame))
        while self._under_way and self._under_way[0][0] <= now_s:
            yield self._under_way.popleft()[1]._replace(stamp_s=now_s)
