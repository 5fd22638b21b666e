"""Conducting an experiment: a place for its results first, then the work with its progress, then report and picture."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from command_line import exit_codes
from command_line.json_output import with_schema
from command_line.screen import Progress, complain, plain
from experiments.reports.report_page import Figure, Section, numbers_reported, write_report

Report = dict[str, Any]
Show = Callable[[int, int], None]


def refuse(message: str) -> int:
    complain(message)
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
    report = with_schema(f"experiment-{options.name}", _run(what, run))
    text = text_of(report)
    if options.out is not None:
        written = _write(options.out, report, text, plot)
        print(f"written  {', '.join(map(str, written))}", file=sys.stderr)
    if options.json:
        print(json.dumps(numbers_reported(report), allow_nan=False))
    else:
        print(text)
    return exit_codes.OK


def _run(what: str, run: Callable[[Show], Report]) -> Report:
    progress = Progress(what)
    try:
        return run(progress.show)
    finally:
        progress.clear()


def _write(folder: Path, report: Report, text: str, plot: Callable[[Report, Path], None] | None) -> list[Path]:
    name = report["experiment"]
    figures = [] if plot is None else [Figure(name, "", partial(plot, report))]
    return write_report(folder, report, f"Experiment: {name}", [Section("Result", screen=plain(text), figures=figures)])
