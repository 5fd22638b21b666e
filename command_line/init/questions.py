"""Asks the questions of a new configuration: a default in brackets, and again after an answer that does not fit."""

from argparse import ArgumentTypeError
from collections.abc import Callable, Collection
from typing import TypeVar

T = TypeVar("T")
Ask = Callable[[str], str]  # prints a prompt and returns a line


def ask(prompt: str, default: T, parse: Callable[[str], T], read: Ask | None) -> T:
    """Return the parsed answer; the default for an empty line, or without a terminal."""
    while read is not None:
        line = read(f"{prompt} [{shown(default)}]: ").strip()
        if not line:
            break
        try:
            return parse(line)
        except (ValueError, ArgumentTypeError) as problem:
            print(f"  {problem}")
    return default


def shown(default: object) -> str:
    return f"{default:.10g}" if isinstance(default, float) else str(default)


def one_of(words: Collection[str]) -> Callable[[str], str]:
    def parse(line: str) -> str:
        if line not in words:
            raise ValueError(f"{line}: must be one of {', '.join(words)}")
        return line

    return parse
