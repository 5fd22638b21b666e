"""Counts questions to one drive and its answers, where a drive sends nothing unless it is asked.

A drive counts as restarted when it answers again after RESTART_SILENCE_S of unanswered questions. More answers than
questions come from a second drive with the same id.
"""

from control.records import NEVER_S

RESTART_SILENCE_S = 0.3
MOST_UNANSWERED = 4  # questions; more were lost, and a second drive's answers must not be taken for theirs
SURPLUS_ANSWERS = 8  # in a row, none SURPLUS_S apart: a second drive
SURPLUS_S = 1.0


class AnswerCounter:
    """Times are those of the reads of the bus: questions leave after a read, and a later one has the answers."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._unanswered = self._surplus = 0
        self._asked_s = self._surplus_s = NEVER_S  # when the oldest unanswered question was asked

    def on_question(self, read_s: float) -> None:
        if not self._unanswered:
            self._asked_s = read_s
        self._unanswered = min(self._unanswered + 1, MOST_UNANSWERED)

    def on_answer(self, read_s: float, read_before_s: float) -> bool:
        """Return whether the drive was silent for so long that it has restarted."""
        restarted = read_before_s - self._asked_s > RESTART_SILENCE_S
        self._asked_s = read_s
        if self._unanswered:
            self._unanswered -= 1
        else:
            self._surplus = self._surplus + 1 if read_s - self._surplus_s < SURPLUS_S else 1
            self._surplus_s = read_s
        return restarted

    def duplicates(self, read_s: float) -> bool:
        """Return whether two drives seem to share this id."""
        return self._surplus >= SURPLUS_ANSWERS and read_s - self._surplus_s < SURPLUS_S
