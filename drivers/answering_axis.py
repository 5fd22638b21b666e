"""What the axes of drives have in common that send nothing unless they are asked: they count questions and answers.

A drive counts as restarted when it answers again after RESTART_SILENCE_S of unanswered questions. More answers than
questions come from a second drive with the same id. Times are those of the reads of the bus: questions leave after a
read, and a later one has the answers.
"""

from math import inf, isfinite
from typing import Any

from control.records import NEVER_S
from drivers.drive import DriveHealth
from drivers.drive_axis import DriveAxis

RESTART_SILENCE_S = 0.3
MOST_UNANSWERED = 16  # questions, 40 ms of late answers; more were lost, and a second drive's are not taken for theirs
SURPLUS_ANSWERS = 8  # in a row, none SURPLUS_S apart: a second drive
SURPLUS_S = 1.0


class AnsweringAxis(DriveAxis):
    """Owns the numbers of questions and answers, and whether the drive is to follow torque."""

    settings: Any  # that were read back; they are of the protocol's own type

    def reset(self) -> None:
        super().reset()
        self._following = False  # commanded by this program
        self._unanswered = self._surplus = 0
        self._question_s = inf  # when the first question since the last answer was asked
        self._surplus_s = NEVER_S
        self.settings.reset()

    def _on_question(self) -> None:
        self._question_s = min(self._question_s, self._read_s)
        self._unanswered = min(self._unanswered + 1, MOST_UNANSWERED)

    def _on_answer(self) -> None:
        """Count an answer, before its signals are stored."""
        silent_s = self._read_before_s - self._question_s
        self._question_s = inf
        if self._unanswered:
            self._unanswered -= 1
        else:
            self._surplus = self._surplus + 1 if self._read_s - self._surplus_s < SURPLUS_S else 1
            self._surplus_s = self._read_s
        if silent_s > RESTART_SILENCE_S and isfinite(self._heartbeat_stamp_s):
            self._on_restart()

    def _on_restart(self) -> None:
        self.restarts += 1
        self.settings.forget()
        self._health = None

    @property
    def duplicates(self) -> bool:
        return self._surplus >= SURPLUS_ANSWERS and self._read_s - self._surplus_s < SURPLUS_S

    def _build_health(self) -> DriveHealth:
        """Add what was read back; a protocol adds its errors."""
        settings = self.settings
        return (
            super()
            ._build_health()
            ._replace(
                firmware=settings.firmware,
                firmware_supported=settings.supported,
                watchdog_s=settings.watchdog_s,
                setting_problem=settings.problem,
                serial_number=settings.serial_number,
                expected_serial_number=self.parameters.serial_number,
            )
        )
