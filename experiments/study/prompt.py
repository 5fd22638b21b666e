"""The operator at the bench, as an experiment asks for help: a person at a terminal, or automatic in simulation."""

from collections.abc import Callable, Mapping
from typing import Protocol

GO_ON, SKIP, REDO = "", "s", "r"  # keys of answers; the first one is the Enter key alone


class Operator(Protocol):
    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        """Return the key of one of `answers` (key to press: meaning). `meanwhile` is called ten times a second."""

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        """Return a number within its bounds."""

    def report(self, message: str) -> None:
        """Show a message."""


class AutomaticOperator:
    """An Operator that gives the first answer at once."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        return next(iter(answers))

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        return low

    def report(self, message: str) -> None:
        self._report(message)
