"""Conducting an experiment at the bench: a folder, a person, progress, and in the end a report.

Whatever ends it early, a fault of the robot or Ctrl-C, the robot is stopped first, and what was measured is in the
folder: the same command goes on from there.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from command_line import exit_codes
from command_line.experiments.terminal_prompt import AbsentOperatorError, TerminalPrompt
from command_line.json_output import with_schema
from command_line.screen import Progress, complain
from experiments.reports.report_page import Section, numbers_reported, write_report
from experiments.robot.bench_errors import BarredError, BenchError, EndedError, GoneError
from experiments.robot.prompt import Operator, Willing
from experiments.trials.notebook import NotebookError, anything_measured
from firmware_host.configuration.file_problems import why_not
from firmware_host.configuration.toml_records import ConfigurationError
from firmware_host.operator.status_client import CallRefusedError

Report = dict[str, Any]
Show = Callable[[int, int], None]


class Desk(NamedTuple):
    """What an experiment works with."""

    folder: Path  # exists
    operator: Operator
    show: Show  # how much is done, of how much


class Finding(NamedTuple):
    """What came of it."""

    report: Report  # with the name of the experiment
    title: str
    sections: Sequence[Section]
    text: str  # for people, on the screen
    logs: Sequence[Path] = ()
    status: int = exit_codes.OK  # another where something that was asked for was not done


def conduct_bench(options: argparse.Namespace, what: str, run: Callable[[Desk], Finding]) -> int:
    """`what` there is progress in. Options are `out`, `json` and `simulated`. `run` leaves the robot at rest."""
    if find_spec("matplotlib") is None:  # before the hours of measuring, not behind them
        raise ModuleNotFoundError(name="matplotlib")
    folder: Path = options.out or Path(f"mudskipper-{options.name}")
    folder.mkdir(parents=True, exist_ok=True)  # what cannot be is refused before the work
    try:
        finding = _run(options, folder, what, run)
        title = f"{finding.title} (simulated)" if options.simulated else finding.title
        report = finding.report | {"simulated": bool(options.simulated)}
        report = with_schema(f"experiment-{options.name}", report)
        written = write_report(folder, report, title, finding.sections, finding.logs)
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED
    except GoneError as problem:
        return _end(folder, str(problem), exit_codes.NO_DAEMON)
    except BarredError as problem:
        return _end(folder, str(problem), exit_codes.NOT_PERMITTED)
    except (BenchError, EndedError, CallRefusedError, AbsentOperatorError) as problem:
        return _end(folder, str(problem), exit_codes.REFUSED)
    except KeyboardInterrupt:
        return _end(folder, "interrupted", exit_codes.INTERRUPTED)
    except OSError as problem:  # such as a full disk
        return _end(folder, why_not(problem, folder), exit_codes.UNHEALTHY)
    if options.json:
        print(json.dumps(numbers_reported(report), allow_nan=False))
    else:
        print(finding.text)
    print(f"written  {', '.join(map(str, written))}", file=sys.stderr)
    return finding.status


def _run(options: argparse.Namespace, folder: Path, what: str, run: Callable[[Desk], Finding]) -> Finding:
    progress = Progress(what)

    def report(message: str) -> None:
        progress.clear()
        print(message, file=sys.stderr, flush=True)

    try:
        return run(
            Desk(folder, Willing(report) if options.simulated else TerminalPrompt(progress.clear), progress.show)
        )
    finally:
        progress.clear()


def _end(folder: Path, message: str, status: int) -> int:
    complain(message)
    if anything_measured(folder):
        complain(f"what was measured is in {folder}: the same command goes on from there")
    return status
