"""Detects two drives that share one node id, from the frames that arrive under it.

Two drives that both send their heartbeats make them arrive twice as often as the period says. Frames that are read in
one tick arrived since the tick before; the earlier of the two times makes the rate a lower bound, so neither a stall of
this program nor a burst of frames can look like a second drive, even if their stamps are wrong. The monitor tells two
heartbeat streams of equal period from one within 16 heartbeats: 0.8 s at the usual 0.1 s after the second drive
appears. The readings of two encoders, which arrive in turns, jump back and forth between two positions, as no joint
does: this shows within 10 readings.
"""

from collections import deque

from control.records import NEVER_S, UNKNOWN

HEARTBEATS = 16  # intervals; one drive needs 16 periods for them, two need 8
WITHIN_PERIODS = 10.0
JUMP_TURNS = 0.1  # from one reading to the next, some 2 ms later
SAME_TURNS = 0.03  # the travel of a joint in two readings
CONTRADICTIONS = 8  # in a row
FORGET_S = 1.0  # without a contradiction, after which they no longer count


class DuplicateNodeMonitor:
    def __init__(self, heartbeat_period_s: float) -> None:
        self._span_s = WITHIN_PERIODS * heartbeat_period_s
        self._earliest_s: deque[float] = deque(maxlen=HEARTBEATS)
        self.reset()

    def reset(self) -> None:
        self._earliest_s.clear()
        self._frequent = self.found = False
        self._turns = self._turns_before = UNKNOWN
        self._contradictions = 0
        self._contradicted_s = NEVER_S

    def on_heartbeat(self, read_s: float, read_before_s: float) -> None:
        """Handle a heartbeat that arrived after `read_before_s` and was read at `read_s`."""
        earliest_s = self._earliest_s
        self._frequent = len(earliest_s) == HEARTBEATS and read_s - earliest_s[0] < self._span_s
        earliest_s.append(read_before_s)
        if read_s - self._contradicted_s > FORGET_S:
            self._contradictions = 0
        self._update_found()

    def on_reading(self, turns: float, read_s: float) -> None:
        """Count a reading that is far from the previous one and equals the one before that."""
        jump = turns - self._turns
        if jump > JUMP_TURNS or jump < -JUMP_TURNS:
            returned = abs(turns - self._turns_before) < SAME_TURNS
            self._contradictions = self._contradictions + 1 if returned else 0
            self._contradicted_s = read_s
            self._update_found()
        self._turns_before = self._turns
        self._turns = turns

    def _update_found(self) -> None:
        self.found = self._frequent or self._contradictions >= CONTRADICTIONS
