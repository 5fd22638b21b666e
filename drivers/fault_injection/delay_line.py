"""Frames on their way that are late, in their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.can.frames import Frame


class DelayLine:
    """Frames that are late. Of those that share a key none overtakes another."""

    def __init__(self, key: Callable[[Frame], int]) -> None:
        self._key = key
        self.waiting: dict[int, deque[tuple[float, Frame]]] = {}

    def put(self, frame: Frame, arrival_s: float) -> None:
        line = self.waiting.setdefault(self._key(frame), deque())
        line.append((max(arrival_s, line[-1][0]) if line else arrival_s, frame))

    def holds_back(self, frame: Frame) -> bool:
        return self._key(frame) in self.waiting

    def take(self, now_s: float) -> list[Frame]:
        """What has arrived by now."""
        arrived: list[Frame] = []
        for key, line in list(self.waiting.items()):
            while line and line[0][0] <= now_s:
                arrived.append(line.popleft()[1])
            if not line:
                del self.waiting[key]
        return arrived
