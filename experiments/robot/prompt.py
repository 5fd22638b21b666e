"""The person at the bench, as an experiment needs them: somebody who does what is asked and says how it went."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

GO_ON, SKIP, REDO = "", "s", "r"  # keys of answers; the first one is the Enter key alone


class Operator(Protocol):
    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        """The key of one of `answers` (key to press, what it means). `meanwhile` is called ten times a second."""

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        """A number within its bounds."""

    def report(self, message: str) -> None:
        """Something that a person should know."""


class AutomaticOperator:
    """Does everything at once and is always content: the person at a simulated bench."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        return next(iter(answers))

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        return low

    def report(self, message: str) -> None:
        self._report(message)
