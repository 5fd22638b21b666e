"""Parses options whose values are texts: a mud with its length, a folder, the file of a picture."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from experiments.study.option import Option

LENGTH = Option("of a mud", low=20.0, high=10000.0, unit="cm")


def mud_length(text: str) -> tuple[str, float]:
    """Parse NAME or NAME=CM; the default length is that of the paper."""
    name, _, length_cm = text.partition("=")
    try:
        if name:
            return name, LENGTH.parse_number(length_cm or "61")
    except argparse.ArgumentTypeError as problem:
        raise argparse.ArgumentTypeError(f"{text}: the length {problem}") from None
    raise argparse.ArgumentTypeError(f"{text}: must be a mud and its length, such as 47.6=61")


MudLengths = Annotated[
    tuple[tuple[str, float], ...],
    Option(
        "as its water in percent, and its length (default: 61), in the order of the track",
        metavar="NAME[=CM]",
        parse=mud_length,
    ),
]


def folder(text: str) -> Path:
    """Accept an existing folder and one that can be made."""
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
