"""Conducting an experiment: a place for its results first, then the work with its progress, then report and picture."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from command_line import exit_codes
from command_line.screen import Progress, complain

Report = dict[str, Any]
Show = Callable[[int, int], None]


def refuse(sentence: str) -> int:
    complain(sentence)
    return exit_codes.USAGE


def conduct(
    options: argparse.Namespace,
    what: str,
    run: Callable[[Show], Report],
    text_of: Callable[[Report], str],
    plot: Callable[[Report, Path], None] | None = None,
) -> int:
    """`what` there is progress in; `plot` draws the report to a file."""
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)  # what cannot be is refused before the minutes of work
    report = _run(what, run)
    if options.out is not None:
        _write(options.out / report["experiment"], report, plot)
    print(json.dumps(report) if options.json else text_of(report))
    return exit_codes.OK


def _run(what: str, run: Callable[[Show], Report]) -> Report:
    progress = Progress(what)
    try:
        return run(progress.show)
    finally:
        progress.clear()


def _write(stem: Path, report: Report, plot: Callable[[Report, Path], None] | None) -> None:
    written = [stem.with_suffix(".json")]
    written[0].write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if plot is not None:
        written.append(stem.with_suffix(".png"))
        plot(report, written[1])
    print(f"written  {', '.join(map(str, written))}", file=sys.stderr)
