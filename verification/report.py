"""Runs every benchmark: reads the options, measures, and prints one JSON object that ends in a verdict.

A benchmark of speed does not judge its figures: it ends with status 0, and its verdict says whether its bar was
reached. One of stress looks for defects and ends with status 1 where its bar is missed. One line on a terminal shows
the progress.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, getfile, getmodule, signature
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

FAST_FOLDER = Path("/dev/shm")  # spares the disk
MAY_BE_ZERO = ("seed", "first", "rate_hz")  # the other numbers are durations, counts and factors


def run_benchmark(measure: Callable[..., dict[str, Any]], arguments: Sequence[str] | None = None) -> int:
    """Calls `measure` with an empty folder and the options, prints its report, and returns the exit status.

    The keyword-only arguments of `measure` are the options; each has a default, which fixes its type.
    """
    path = Path(getfile(measure))
    parser = argparse.ArgumentParser(
        prog=f"python -m verification.{path.parent.name}.{path.stem}",
        description=getattr(getmodule(measure), "__doc__", None),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", action="store_true", help="print the report on one line")
    for name, option in signature(measure).parameters.items():
        if option.kind is Parameter.KEYWORD_ONLY:
            kind = type(option.default)
            parser.add_argument(f"--{name.replace('_', '-')}", type=kind, default=option.default, help="%(default)s")
    options = vars(parser.parse_args(arguments))
    indent = None if options.pop("json") else 1
    _require_positive(options)
    with TemporaryDirectory(prefix="mud-", dir=FAST_FOLDER if FAST_FOLDER.is_dir() else None) as folder:
        report = {"benchmark": path.stem} | measure(Path(folder), **options)
    show_progress(1, 1, "done\n")
    print(json.dumps(report, indent=indent))
    return 1 if path.parent.name == "stress" and not report["reached"] else 0


def _require_positive(options: Mapping[str, Any]) -> None:
    """Ends the benchmark before it measures where it would measure nothing."""
    for name, value in options.items():
        if not isinstance(value, str) and name not in MAY_BE_ZERO and not 0 < value < inf:
            raise SystemExit(f"--{name.replace('_', '-')} {value:g}: must be more than 0 and finite")


def evaluated(report: dict[str, Any], bar: str, reached: bool) -> dict[str, Any]:
    return report | {"reached": reached, "verdict": f"{bar}: {'reached' if reached else 'not reached'}"}


def summary_us(durations_s: Sequence[float]) -> dict[str, float]:
    """Returns median, p99 and maximum in microseconds; zeros where nothing was measured."""
    ordered = sorted(durations_s) or [0.0]
    last = len(ordered) - 1
    fractions = {"median": 0.50, "p99": 0.99, "max": 1.0}
    return {name: round(1e6 * ordered[round(fraction * last)], 2) for name, fraction in fractions.items()}


def show_progress(done: float, total: float, what: str) -> None:
    """Writes one line on a terminal's stderr, and nothing anywhere else."""
    if sys.stderr.isatty():
        print(f"\r\033[K{min(1.0, done / total):4.0%}  {what}", end="", file=sys.stderr, flush=True)
