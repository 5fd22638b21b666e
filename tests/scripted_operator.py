"""An operator for tests: gives scripted answers, and records questions and messages."""

from collections.abc import Callable, Mapping


class ScriptedOperator:
    """An Operator that gives the listed `answers` and then the first possible answer of each question."""

    def __init__(self, *answers: str) -> None:
        self.answers = list(answers)
        self.asked: list[str] = []
        self.offered: list[Mapping[str, str]] = []
        self.reported: list[str] = []

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        self.asked.append(question)
        self.offered.append(answers)
        meanwhile()
        answer = self.answers.pop(0) if self.answers else next(iter(answers))
        assert answer in answers
        return answer

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        self.asked.append(question)
        return low

    def report(self, message: str) -> None:
        self.reported.append(message)
