"""Runs an experiment from the command line: folder, progress and prompts before it, report and exit status after it.

An interrupted experiment stops its robot first. Its folder holds the trials that it measured, and the same command
continues from there.
"""

import argparse
import json
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from command_line import exit_codes
from command_line.experiments.terminal_prompt import TerminalPrompt
from command_line.json_output import print_value, with_schema
from command_line.screen import Progress, complain
from experiments.reports.report_page import SUMMARY, to_json, write_report
from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError, EndedError
from experiments.robot.prompt import AutomaticOperator
from experiments.trials.notebook import Notebook, NotebookError, anything_measured
from experiments.trials.parallel_trials import WorkersError
from experiments.trials.session import Ending, Finding, Session, Show
from firmware_host.configuration.file_problems import ConfigurationError, why_not
from operator_client.status_client import CallRefusedError

EXIT_STATUS = {Ending.DONE: exit_codes.OK, Ending.UNHEALTHY: exit_codes.UNHEALTHY, Ending.REFUSED: exit_codes.REFUSED}
NOT_COMPARED = (
    "command",
    "name",
    "function",
    "json",
    "out",
    "workers",
    "cluster",
)  # of the options of a computed experiment
Result = TypeVar("Result")


def refuse(message: str) -> int:
    complain(message)
    return exit_codes.USAGE


def conduct(options: argparse.Namespace, unit: str, run: Callable[[Show], Finding]) -> int:
    """Run a computed experiment, which writes files only with --out. `unit` names what the progress bar counts."""
    try:
        notebook = _notebook_of_options(options) if options.out else None  # refused before minutes of work
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED
    try:
        finding = _run(unit, lambda progress: run(progress.show))
    except WorkersError as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    report = with_schema(f"experiment-{options.name}", to_json(finding.report))
    if notebook is not None:
        _print_written(write_report(options.out, report, finding.title, finding.sections))
        notebook.write("report", {"title": finding.title})
    _print_finding(report, finding, options.json)
    return EXIT_STATUS[finding.ending]


def conduct_bench(
    options: argparse.Namespace, unit: str, run: Callable[[Session], Finding], needs: str = "matplotlib"
) -> int:
    """Run an experiment that has a folder and an operator. `run` leaves the robot at rest, however it ends.

    `needs` is the module of an extra that writes the results.
    """
    if find_spec(needs) is None:  # it is reported before the hours of measuring
        raise ModuleNotFoundError(name=needs)
    folder: Path = options.out or Path(f"mudskipper-{options.name}")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        _require_own_folder(folder, options.name)
        finding = _run(unit, lambda progress: run(_session(options, folder, progress)))
        title = f"{finding.title} (simulated)" if options.simulated else finding.title
        report = with_schema(
            f"experiment-{options.name}", to_json(finding.report) | {"simulated": bool(options.simulated)}
        )
        written = write_report(folder, report, title, finding.sections, finding.logs)
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED
    except (BenchError, EndedError, CallRefusedError, WorkersError, KeyboardInterrupt, OSError) as problem:
        return _end_early(folder, problem)
    _print_finding(report, finding, options.json)
    _print_written(written)
    return EXIT_STATUS[finding.ending]


def _notebook_of_options(options: argparse.Namespace) -> Notebook:
    """Return a notebook whose plan is what was typed. Raises NotebookError for a report of other options."""
    _require_own_folder(options.out, options.name)
    typed = {name: value for name, value in vars(options).items() if name not in NOT_COMPARED}
    return Notebook(options.out, json.loads(json.dumps({"experiment": options.name} | typed, default=str)))


def _require_own_folder(folder: Path, name: str) -> None:
    """Raises NotebookError for the results of another experiment."""
    earlier = name
    with suppress(OSError, ValueError, AttributeError):
        earlier = json.loads((folder / SUMMARY).read_bytes()).get("experiment", name)
    if earlier != name:
        raise NotebookError(f"{folder} has the results of experiment {earlier}: choose another folder with --out")


def _run(unit: str, run: Callable[[Progress], Result]) -> Result:
    progress = Progress(unit)
    try:
        return run(progress)
    finally:
        progress.clear()


def _session(options: argparse.Namespace, folder: Path, progress: Progress) -> Session:
    prompt = TerminalPrompt(progress.clear)
    if options.simulated:
        return Session(folder, AutomaticOperator(prompt.report), progress.show)
    return Session(folder, prompt, progress.show, getattr(options, "socket", None))


def _print_finding(report: dict[str, Any], finding: Finding, as_json: bool) -> None:
    if as_json:
        print_value(report)
    else:
        print(finding.text)


def _print_written(paths: list[Path]) -> None:
    print(f"written  {', '.join(map(str, paths))}", file=sys.stderr)


def _end_early(folder: Path, problem: BaseException) -> int:
    message, status = str(problem), exit_codes.REFUSED
    match problem:
        case DaemonLostError():
            status = exit_codes.NO_DAEMON
        case AccessDeniedError():
            status = exit_codes.NOT_PERMITTED
        case KeyboardInterrupt():
            message, status = "interrupted", exit_codes.INTERRUPTED
        case WorkersError():
            status = exit_codes.UNHEALTHY
        case OSError():  # such as a full disk
            message, status = why_not(problem, folder), exit_codes.UNHEALTHY
    complain(message)
    if anything_measured(folder):
        complain(f"the measurements so far are in {folder}; the same command continues from there")
    return status
