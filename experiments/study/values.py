"""Parses the values of options and refuses those outside their bounds, in the unit that the user typed."""

import argparse
from collections.abc import Callable
from contextlib import suppress
from math import nan
from pathlib import Path


def _number(text: str) -> float:
    """Returns NaN for a text that is no number; every condition refuses it."""
    with suppress(ValueError):
        return float(text)
    return nan


def _number_where(allowed: Callable[[float], bool], must_be: str) -> Callable[[str], float]:
    """Returns a parser of numbers that are `allowed`."""

    def value_of(text: str) -> float:
        value = _number(text)
        if not allowed(value):
            raise argparse.ArgumentTypeError(f"{text}: must be {must_be}")
        return value

    return value_of


def whole(low: int, high: int) -> Callable[[str], int]:
    """Returns a parser of whole numbers from `low` to `high`."""
    must_be = f"a whole number from {low} to {high}"
    value_of = _number_where(lambda value: low <= value <= high and value == int(value), must_be)
    return lambda text: int(value_of(text))


def mud_length(text: str) -> tuple[str, float]:
    """Parses NAME or NAME=CM; the default length is that of the paper."""
    name, _, length_cm = text.partition("=")
    value = _number(length_cm or "61")
    if not (name and 20.0 <= value <= 10000.0):
        raise argparse.ArgumentTypeError(f"{text}: must be a mud and its length from 20 to 10000 cm, such as 47.6=61")
    return name, value


def folder(text: str) -> Path:
    """Accepts an existing folder and one that can be made."""
    path = Path(text)
    if path.exists() and not path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: must be a folder")
    return path


def picture(*endings: str) -> Callable[[str], Path]:
    def path(text: str) -> Path:
        if not text.endswith(endings):
            raise argparse.ArgumentTypeError(f"{text}: must end with {' or '.join(endings)}")
        return Path(text)

    return path
