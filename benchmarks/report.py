"""Runs every benchmark: it parses the arguments, measures, and prints one JSON object, or tables and a verdict.

A benchmark of figures does not judge them: it ends with status 0, and its verdict says whether its bar was reached. A
benchmark that looks for defects ends with status 1 where its bar is missed. One line on a terminal shows the progress.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from experiments.reports.text_tables import table

FAST_FOLDER = Path("/dev/shm")  # spares the disk


def new_parser(module: str, description: str | None) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"python -m {module}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    return parser


def run_benchmark(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    measure: Callable[[argparse.Namespace, Path], dict[str, Any]],
    finds_defects: bool = False,
) -> int:
    """Runs `measure` with the options and an empty folder, prints its report, and returns the exit status."""
    options = parser.parse_args(arguments)
    with TemporaryDirectory(prefix="mud-", dir=FAST_FOLDER if FAST_FOLDER.is_dir() else None) as folder:
        report = {"benchmark": parser.prog.split(".")[-1]} | measure(options, Path(folder))
    Progress(1.0).clear()
    print(json.dumps(report) if options.json else "\n".join([*report_lines(report), report["verdict"]]))
    return 1 if finds_defects and not report["reached"] else 0


def report_lines(report: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Yields the figures of a report: records with equal keys as one table, any other value on a line of its own."""
    for name, value in report.items():
        rows = record_rows(value)
        if rows:
            yield f"{prefix}{name}:\n{table(rows)}\n"
        elif isinstance(value, dict) and any(isinstance(inner, dict | list) for inner in value.values()):
            yield from report_lines(value, f"{prefix}{name} ")
        elif name != "verdict":
            yield f"{prefix}{name}: {cell_text(value)}"


def record_rows(records: Any) -> list[list[str]]:
    """Returns the rows of a table, head first; none where the value is not a collection of records with equal keys."""
    named = records if isinstance(records, dict) else dict(enumerate(records if isinstance(records, list) else [], 1))
    values = list(named.values())
    if not values or not all(isinstance(value, dict) and value.keys() == values[0].keys() for value in values):
        return []
    if any(isinstance(inner, dict) for value in values for inner in value.values()):
        return []
    return [["", *values[0]], *([str(name), *map(cell_text, value.values())] for name, value in named.items())]


def cell_text(value: Any) -> str:
    """Writes a value on one line."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {cell_text(inner)}" for name, inner in value.items()) or "none"
    if isinstance(value, list):
        return "; ".join(map(cell_text, value)) or "none"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def evaluated(report: dict[str, Any], bar: str, reached: bool) -> dict[str, Any]:
    return report | {"reached": reached, "verdict": f"{bar}: {'reached' if reached else 'not reached'}"}


def summary_us(durations_s: Sequence[float]) -> dict[str, float]:
    """Returns median, p99 and maximum in microseconds; zeros where nothing was measured."""
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
