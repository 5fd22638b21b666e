"""Runs every benchmark: reads the options, measures, compares in turns, and prints one JSON object with a verdict.

A benchmark of speed ends with status 0, and its verdict says whether its bar was reached. One of stress looks for
defects and ends with status 1 where its bar is missed. One line on a terminal shows the progress.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, getfile, getmodule, signature
from math import inf, pi, sqrt
from pathlib import Path
from statistics import median, stdev
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

Report = dict[str, Any]
Measured = TypeVar("Measured")
FAST_FOLDER = Path("/dev/shm")  # spares the disk
MAY_BE_ZERO = ("seed", "first", "rate_hz")  # the other numbers are durations, counts and factors


def run_benchmark(measure: Callable[..., Report], arguments: Sequence[str] | None = None) -> int:
    """Call `measure` with an empty folder and the options, print its report, and return the exit status.

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
    """End the benchmark before it measures where it would measure nothing."""
    for name, value in options.items():
        if not isinstance(value, str) and name not in MAY_BE_ZERO and not 0 < value < inf:
            raise SystemExit(f"--{name.replace('_', '-')} {value:g}: must be more than 0 and finite")


def measure_in_turns(turns: Mapping[str, Callable[[], Measured]], rounds: int) -> dict[str, list[Measured]]:
    """Measure each of several things once in every round, so that all of them see the same machine.

    The order changes from round to round, so none profits from its place. Return the measurements by name.
    """
    measured: dict[str, list[Measured]] = {name: [] for name in turns}
    for number in range(rounds):
        order = list(turns)[:: -1 if number % 2 else 1]
        for part, name in enumerate(order):
            show_progress(number + part / len(order), rounds, name)
            measured[name].append(turns[name]())
    return measured


def paired_ratio(numerators: Sequence[float], denominators: Sequence[float]) -> Report:
    """Return the median ratio of measurements that were made in turns, with its standard error."""
    ratios = [a / b for a, b in zip(numerators, denominators, strict=True)]
    error = stdev(ratios) * sqrt(pi / 2.0 / len(ratios)) if len(ratios) > 1 else None  # of a median
    return {"ratio": round(median(ratios), 3), "std_error": error and round(error, 3)}


def evaluated(report: Report, bar: str, reached: bool) -> Report:
    return report | {"reached": reached, "verdict": f"{bar}: {'reached' if reached else 'not reached'}"}


def show_progress(done: float, total: float, what: str) -> None:
    """Write one line on a terminal's stderr, and nothing anywhere else."""
    if sys.stderr.isatty():
        print(f"\r\033[K{min(1.0, done / total):4.0%}  {what}", end="", file=sys.stderr, flush=True)
