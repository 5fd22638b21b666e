"""Runs an experiment from the command line: folder, progress and prompts before it, report and exit status after it.

An interrupted experiment stops its robot first. Its folder holds the trials that it measured, and the same command
continues from there. Every report carries what computed it.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from command_line import exit_codes
from command_line.experiments.terminal_prompt import TerminalPrompt
from command_line.screen import Progress, complain
from experiments.robot.bench_errors import AccessDeniedError, DaemonLostError
from experiments.study.notebook import count_entries
from experiments.study.prompt import AutomaticOperator
from experiments.study.results_folder import make_folder, require_unfinished, set_aside
from experiments.study.session import Ending, Session
from experiments.study.workers import WorkersError
from firmware_host.configuration.file_problems import why_not

EXIT_STATUS = {Ending.DONE: exit_codes.OK, Ending.UNHEALTHY: exit_codes.UNHEALTHY, Ending.REFUSED: exit_codes.REFUSED}
Result = TypeVar("Result")


def refuse(message: str) -> int:
    complain(message)
    return exit_codes.USAGE


def open_folder(options: argparse.Namespace, typed: Mapping[str, Any], name: str = "") -> Path:
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
