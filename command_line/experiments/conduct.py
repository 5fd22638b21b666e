"""Runs an experiment from the command line: folder, progress and prompts before it, report and exit status after it.

An interrupted experiment stops its robot first. Its folder holds the trials that it measured, and the same command
continues from there. Every report carries what computed it.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from command_line import exit_codes
from command_line.experiments.terminal_prompt import TerminalPrompt
from command_line.json_output import print_value
from command_line.screen import Progress, complain
from experiments.reports.report_page import PAGE, to_json, write_report
from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError, EndedError
from experiments.robot.prompt import AutomaticOperator
from experiments.study.notebook import NotebookError, count_entries, plan_in
from experiments.study.provenance import identity, provenance
from experiments.study.results_folder import make_folder, remove_unused, require_unfinished, set_aside
from experiments.study.session import Ending, Session, Show
from experiments.study.workers import WorkersError
from experiments.trials.session import Finding
from firmware_host.configuration.file_problems import ConfigurationError, why_not
from operator_client.status_client import CallRefusedError

EXIT_STATUS = {Ending.DONE: exit_codes.OK, Ending.UNHEALTHY: exit_codes.UNHEALTHY, Ending.REFUSED: exit_codes.REFUSED}
NO_INPUT = {  # options on which no result depends
    "version", "print_completion", "command", "name", "function", "json", "out", "restart", "workers", "cluster",
    "socket",
}  # fmt: skip
Result = TypeVar("Result")


def refuse(message: str) -> int:
    complain(message)
    return exit_codes.USAGE


def conduct(options: argparse.Namespace, unit: str, run: Callable[[Show], Finding], *modules: str) -> int:
    """Run a computed experiment, which writes files only with --out. `unit` names what the progress bar counts.

    `modules` compute the report.
    """
    identity(*modules)  # reads the sources before minutes of work, in which they may change
    try:
        folder = open_folder(options, None) if options.out else None
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED
    try:
        finding = run_with_progress(unit, lambda progress: run(progress.show))
    except WorkersError as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    record = provenance(*modules) | {"options": _typed(options)}
    report = _schema(options) | to_json(finding.report) | {"provenance": record}
    if folder is not None:
        print_written(write_report(folder, report, finding.title, finding.sections))
    _print_finding(report, finding, options.json)
    return EXIT_STATUS[finding.ending]


def conduct_bench(
    options: argparse.Namespace,
    unit: str,
    run: Callable[[Session], Finding],
    *modules: str,
    folder_name: str = "",
    needs: str = "matplotlib",
) -> int:
    """Run an experiment that has a folder and an operator. `run` leaves the robot at rest, however it ends.

    `modules` compute the report. `needs` is the module of an extra that writes the results.
    """
    if find_spec(needs) is None:  # it is reported before the hours of measuring
        raise ModuleNotFoundError(name=needs)
    try:
        folder = open_folder(options, _typed(options), folder_name)
        status = _conduct_in(folder, options, unit, run, modules)
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED
    if options.out is None:
        remove_unused(folder)
    return status


def _conduct_in(
    folder: Path, options: argparse.Namespace, unit: str, run: Callable[[Session], Finding], modules: Sequence[str]
) -> int:
    program, before = identity(*modules), count_entries(folder) if (folder / PAGE).exists() else None
    try:
        finding = run_with_progress(unit, lambda progress: run(session_in(options, folder, progress, program)))
        title = f"{finding.title} (simulated)" if options.simulated else finding.title
        record = provenance(*modules) | {"options": _typed(options), "plan": plan_in(folder)}
        also = {"simulated": bool(options.simulated), "provenance": record}
        report = _schema(options) | to_json(finding.report) | also
        written = write_report(folder, report, title, finding.sections, finding.logs)
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    except (BenchError, EndedError, CallRefusedError, WorkersError, KeyboardInterrupt, OSError) as problem:
        return end_early(folder, problem)
    if before == count_entries(folder):
        print(f"{folder} had every measurement already; they are only evaluated again", file=sys.stderr)
    _print_finding(report, finding, options.json)
    print_written(written)
    return EXIT_STATUS[finding.ending]


def _schema(options: argparse.Namespace) -> dict[str, str]:
    return {"schema": f"experiment-{options.name}/1"}


def _typed(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options that a report depends on, as JSON has them."""
    typed = {name: value for name, value in vars(options).items() if name not in NO_INPUT}
    return dict(json.loads(json.dumps(typed, default=str)))


def open_folder(options: argparse.Namespace, typed: Mapping[str, Any] | None, name: str = "") -> Path:
    """Return the folder of the results: without --out a new one. Raises NotebookError, OSError.

    A finished study continues with options other than `typed`, such as more trials.
    """
    if options.out is None:
        return make_folder(f"mudskipper-{name or options.name}")
    folder: Path = options.out.resolve() if options.restart else options.out  # the working directory moves too
    if options.restart and (old := set_aside(folder)):
        print(f"the earlier results are in {old} now", file=sys.stderr)
    require_unfinished(folder, options.name, typed)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def run_with_progress(unit: str, run: Callable[[Progress], Result]) -> Result:
    progress = Progress(unit)
    try:
        return run(progress)
    finally:
        progress.clear()


def session_in(options: argparse.Namespace, folder: Path, progress: Progress, program: Mapping[str, str]) -> Session:
    prompt = TerminalPrompt(progress.clear)
    if options.simulated:
        operator = AutomaticOperator(prompt.report)
        return Session(folder, operator, progress.show, simulated=True, program=program)
    return Session(folder, prompt, progress.show, getattr(options, "socket", None), program=program)


def _print_finding(report: dict[str, Any], finding: Finding, as_json: bool) -> None:
    if as_json:
        print_value(report)
    else:
        print(finding.text)


def print_written(paths: list[Path]) -> None:
    print(f"written  {', '.join(map(str, paths))}", file=sys.stderr)


def end_early(folder: Path, problem: BaseException) -> int:
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
    if count_entries(folder):
        complain(f"the measurements so far are in {folder}; the same command with --out {folder} continues from there")
    return status
