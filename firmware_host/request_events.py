"""Limits the log to requests that change something, and to one a second of the same kind.

A client may send 200 requests for a stop in a second; the log must not fill with them. Requests that are left out are
counted: the next logged request says how many preceded it, and the status gives the total.
"""

from __future__ import annotations

from math import inf

PERIOD_S = 1.0
MAX_TEXTS = 64  # every text names its sender


class RequestEvents:
    """Owns the time at which each request was logged last."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.unlogged = 0  # since the start
        self._unlogged_before = 0  # since the last request that was logged
        self._logged_s: dict[str, float] = {}

    def update(self, text: str, changes: bool, now_s: float) -> str:
        """Return the message for the log, or an empty text."""
        if not changes or now_s - self._logged_s.get(text, -inf) < PERIOD_S:
            self.unlogged += 1
            self._unlogged_before += 1
            return ""
        if len(self._logged_s) >= MAX_TEXTS:
            self._logged_s.clear()
        self._logged_s[text] = now_s
        before, self._unlogged_before = self._unlogged_before, 0
        return f"{text}; {before} before it changed nothing or were repeated" if before else text
