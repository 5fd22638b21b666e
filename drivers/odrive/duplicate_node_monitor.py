"""Whether two drives share one id, from what arrives under it.

Two that both send their heartbeats make them come twice as often as the period says. What is read in one tick arrived
since the tick before; the earlier of both moments makes a rate a lower bound, so that neither a stall of ours nor
frames in a bunch can look like a second drive, whatever a frame's stamp says. Two heartbeat streams of equal period
are told apart from one within 16 heartbeats: 0.8 s at the usual 0.1 s after the second drive appears. And readings of
two encoders that come in turns jump to and fro between two places, which no joint does: that shows within 10 readings.
"""

from __future__ import annotations

from collections import deque

from control.records import NEVER_S, UNKNOWN

HEARTBEATS = 16  # intervals; one drive needs 16 periods for them, two need 8
WITHIN_PERIODS = 10.0
JUMP_TURNS = 0.1  # from one reading to the next, some 2 ms later
SAME_TURNS = 0.03  # a joint's own way in two readings
CONTRADICTIONS = 8  # one after the other
FADING_S = 1.0  # without a contradiction, and they are forgotten


class DuplicateNodeMonitor:
    def __init__(self, heartbeat_period_s: float) -> None:
        self._span_s = WITHIN_PERIODS * heartbeat_period_s
        self._earliest_s: deque[float] = deque(maxlen=HEARTBEATS)
        self.reset()

    def reset(self) -> None:
        self._earliest_s.clear()
        self._frequent = False
        self._turns = self._turns_before = UNKNOWN
        self._contradictions = 0
        self._contradicted_s = NEVER_S

    @property
    def seen(self) -> bool:
        return self._frequent or self._contradictions >= CONTRADICTIONS

    def on_heartbeat(self, read_s: float, read_before_s: float) -> None:
        """Of what is read at `read_s` all came after `read_before_s`."""
        earliest_s = self._earliest_s
        self._frequent = len(earliest_s) == HEARTBEATS and read_s - earliest_s[0] < self._span_s
        earliest_s.append(read_before_s)
        if read_s - self._contradicted_s > FADING_S:
            self._contradictions = 0

    def on_reading(self, turns: float, read_s: float) -> None:
        """To and fro: far from the reading before, but where the one before that was."""
        jump = turns - self._turns
        if jump > JUMP_TURNS or jump < -JUMP_TURNS:
            there_before = abs(turns - self._turns_before) < SAME_TURNS
            self._contradictions = self._contradictions + 1 if there_before else 0
            self._contradicted_s = read_s
        self._turns_before = self._turns
        self._turns = turns
