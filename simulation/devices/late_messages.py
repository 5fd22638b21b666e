"""Messages that arrive late, by uniformly drawn times, and in order: none overtakes another."""

from collections import deque
from collections.abc import Iterable, Iterator
from random import Random

from drivers.can.frames import Frame


class LateMessages:
    """Owns the messages in transit."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self.reset()

    def reset(self) -> None:
        self._in_transit: deque[tuple[float, Frame]] = deque()  # (arrival, frame)

    def update(self, frames: Iterable[Frame], now_s: float, longest_s: float) -> Iterator[Frame]:
        """Yield the frames that arrive by now, at most `longest_s` late, stamped with the time of arrival."""
        for frame in frames:
            arrival_s = now_s + longest_s * self._random.random()
            if self._in_transit:
                arrival_s = max(arrival_s, self._in_transit[-1][0])
            self._in_transit.append((arrival_s, frame))
        while self._in_transit and self._in_transit[0][0] <= now_s:
            yield self._in_transit.popleft()[1]._replace(stamp_s=now_s)
