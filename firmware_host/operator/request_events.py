"""Which requests the log tells of: those that change anything, and of the same one no more than one a second.

Whoever is let in may ask 200 times a second for a stop, and the log is kept for other things. What is left out is
counted: the next one that is told says how many there were before it, and the status how many in all.
"""

from __future__ import annotations

from math import inf

PERIOD_S = 1.0
MOST_KEPT = 64  # texts, each of which names who asked


class RequestEvents:
    """Owns when each was told last."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.untold = 0  # since the start
        self._before = 0  # since the last one that was told
        self._reported_s: dict[str, float] = {}

    def update(self, text: str, changes: bool, now_s: float) -> str:
        """The sentence for the log, or nothing."""
        if not changes or now_s - self._reported_s.get(text, -inf) < PERIOD_S:
            self.untold += 1
            self._before += 1
            return ""
        if len(self._reported_s) >= MOST_KEPT:
            self._reported_s.clear()
        self._reported_s[text] = now_s
        before, self._before = self._before, 0
        return f"{text}; {before} before it changed nothing or came again" if before else text
