"""A queue of delayed frames that preserves their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.can.frames import Frame


class DelayLine:
    """Delays frames. A frame never overtakes another one with the same key."""

    def __init__(self, key: Callable[[Frame], int]) -> None:
        self._key = key
        self.waiting: dict[int, deque[tuple[float, Frame]]] = {}

    def put(self, frame: Frame, arrival_s: float) -> None:
        line = self.waiting.setdefault(self._key(frame), deque())
        line.append((max(arrival_s, line[-1][0]) if line else arrival_s, frame))

    def holds_back(self, frame: Frame) -> bool:
        return self._key(frame) in self.waiting

    def pop_arrived(self, now_s: float) -> list[Frame]:
        """Removes and returns the frames that have arrived by now."""
        arrived: list[Frame] = []
        for key, line in list(self.waiting.items()):
            while line and line[0][0] <= now_s:
                arrived.append(line.popleft()[1])
            if not line:
                del self.waiting[key]
        return arrived
