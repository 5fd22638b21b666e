"""What every benchmark prints: one JSON object for a program, or a table and a verdict for a person.

A benchmark of figures does not judge: it ends with status 0 whatever it measured, and its verdict says which bar was
reached. One that looks for defects ends with status 1 where its own is missed.
While it runs, one line on a terminal says how far it is.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any


def new_parser(module: str, description: str | None) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"python -m {module}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    return parser


def print_report(report: dict[str, Any], text: str, as_json: bool) -> None:
    print(json.dumps(report) if as_json else text)


def verdict(bar: str, reached: bool) -> str:
    return f"{bar}: {'reached' if reached else 'not reached'}"


def summary_us(durations_s: Sequence[float]) -> dict[str, float]:
    """Median, p99 and the longest in microseconds; zeros where nothing was measured."""
    ordered = sorted(durations_s) or [0.0]
    last = len(ordered) - 1
    fractions = {"median": 0.50, "p99": 0.99, "max": 1.0}
    return {name: round(1e6 * ordered[round(fraction * last)], 2) for name, fraction in fractions.items()}


class Progress:
    """One line on a terminal's stderr, silent anywhere else."""

    def __init__(self, total: float) -> None:
        self._total = total
        self._shown = sys.stderr.isatty()

    def show(self, done: float, what: str) -> None:
        if self._shown:
            fraction = min(1.0, done / self._total)
            print(f"\r\033[K{fraction:4.0%}  {what}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
