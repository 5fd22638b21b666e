"""Prompts for the operator on a terminal. The robot is attended while an answer is awaited.

A terminal's input is discarded before each question: a second Enter, pressed too early, would otherwise confirm that
the hands are out of the mud. A file or a pipe holds nothing but answers, so all of it counts.
"""

import math
import os
import select
import sys
import termios
from collections.abc import Callable, Mapping

from experiments.robot.bench_errors import EndedError

POLL_S = 0.1


class TerminalPrompt:
    """An Operator at a terminal. Questions go to standard error, so that standard output carries data alone."""

    def __init__(self, make_room: Callable[[], None] = lambda: None) -> None:
        """`make_room` is called before each message and clears the line of a progress bar."""
        self._make_room = make_room

    def ask(self, question: str, answers: Mapping[str, str], meanwhile: Callable[[], None]) -> str:
        offered = ", ".join(f"{key or 'Enter'}: {meaning}" for key, meaning in answers.items())
        while True:
            answer = self._read_line(f"{question}\n  [{offered}] ", meanwhile).lower()
            if answer in answers:
                return answer
            self.report(f"{answer!r} is none of the answers")

    def ask_number(self, question: str, low: float, high: float, meanwhile: Callable[[], None]) -> float:
        while True:
            answer = self._read_line(f"{question} ", meanwhile)
            try:
                number = float(answer.replace(",", "."))
            except ValueError:
                number = math.nan
            if low <= number <= high:
                return number
            self.report(f"{answer!r} is no number from {low:g} to {high:g}")

    def report(self, message: str) -> None:
        self._make_room()
        print(message, file=sys.stderr, flush=True)

    def _read_line(self, prompt: str, meanwhile: Callable[[], None]) -> str:
        """Return one line. Raises EndedError at the end of the input."""
        if sys.stdin.isatty():
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
        self._make_room()
        print(prompt, end="", file=sys.stderr, flush=True)
        line = b""
        while not line.endswith(b"\n"):  # by bytes: a buffer would hide the next answer of a pipe from `select`
            while not select.select([sys.stdin], [], [], POLL_S)[0]:
                meanwhile()
            if not (byte := os.read(sys.stdin.fileno(), 1)):
                break
            line += byte
        if not line:
            raise EndedError("the input has ended, but the operator has to answer: run this on a terminal")
        return line.decode(errors="replace").strip()
