"""The person at the bench, asked on a terminal. While an answer is waited for the robot is looked after.

Only what is typed after a question answers it: an Enter pressed twice would else say that the hands are out of the mud,
before that was asked. What comes from a file or a pipe was never meant as anything but answers, and all of it counts.
"""

from __future__ import annotations

import math
import select
import sys
import termios
from collections.abc import Callable, Mapping

LOOK_S = 0.1


class AbsentOperatorError(Exception):
    """Nobody can be asked: the input has ended."""


class TerminalPrompt:
    """A Person. Questions go to standard error, so that data can be piped."""

    def __init__(self, make_room: Callable[[], None] = lambda: None) -> None:
        """`make_room` is called before every word: a bar of progress stands in its line."""
        self._make_room = make_room

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        offered = ", ".join(f"{key or 'Enter'}: {meaning}" for key, meaning in answers.items())
        while True:
            said = self._hear(f"{question}\n  [{offered}] ", meanwhile).lower()
            if said in answers:
                return said
            self.report(f"{said!r} is none of the answers")

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        while True:
            said = self._hear(f"{question} ", meanwhile)
            try:
                number = float(said.replace(",", "."))
            except ValueError:
                number = math.nan
            if low <= number <= high:
                return number
            self.report(f"{said!r} is no number from {low:g} to {high:g}")

    def report(self, message: str) -> None:
        self._make_room()
        print(message, file=sys.stderr, flush=True)

    def _hear(self, prompt: str, meanwhile: Callable[[], None]) -> str:
        """One line. Raises AbsentPersonError where there will be none."""
        if sys.stdin.isatty():
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
        self._make_room()
        print(prompt, end="", file=sys.stderr, flush=True)
        while not select.select([sys.stdin], [], [], LOOK_S)[0]:
            meanwhile()
        line = sys.stdin.readline()
        if not line:
            raise AbsentOperatorError("the input has ended, and a person has to be asked: run it on a terminal")
        return line.strip()
