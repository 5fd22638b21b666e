"""Messages that arrive late, by uniformly drawn times, and in order: none overtakes another.

A drive that sends nothing by itself has `LateAnswers`, whose values may also be those of the answer before.
"""

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
        """Yields the frames that arrive by now, at most `longest_s` late, stamped with the time of arrival."""
        for frame in frames:
            arrival_s = now_s + longest_s * self._random.random()
            if self._in_transit:
                arrival_s = max(arrival_s, self._in_transit[-1][0])
            self._in_transit.append((arrival_s, frame))
        while self._in_transit and self._in_transit[0][0] <= now_s:
            yield self._in_transit.popleft()[1]._replace(stamp_s=now_s)


class LateAnswers:
    """Owns the answers of one drive that have not arrived yet, and the values of the newest one."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._late = LateMessages(random)
        self.reset()

    def reset(self) -> None:
        self._late.reset()
        self._given: list[Frame] = []
        self._values: bytes | None = None

    def new_or_repeated(self, values: bytes, fraction: float) -> bytes:
        """Returns the values of an answer; in this fraction of all answers, at random, those of the one before."""
        if not fraction:
            return values
        if self._values is None or self._random.random() >= fraction:
            self._values = values
        return self._values

    def give(self, answer: Frame, longest_s: float) -> list[Frame]:
        """Returns the answer if it arrives at once, which is where `longest_s` is zero."""
        if not longest_s:
            return [answer]
        self._given.append(answer)
        return []

    def arrived(self, now_s: float, longest_s: float) -> Iterable[Frame]:
        """Returns the late answers that have arrived by now."""
        if not longest_s:
            return ()
        given, self._given = self._given, []
        return self._late.update(given, now_s, longest_s)
