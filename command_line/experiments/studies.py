"""Runs a study from the command line: folder, progress and prompts before it, page, numbers and exit status after it.

An interrupted experiment stops its robot first. Its folder holds the trials that it measured, and the same command
continues from there. Every report carries what computed it.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from command_line import exit_codes
from command_line.experiments.terminal_prompt import TerminalPrompt
from command_line.function_options import flag_of, given_options
from command_line.json_output import print_value
from command_line.options.studies import has_files, takes_session
from command_line.screen import Progress, complain
from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError, EndedError
from experiments.study.catalogue import load_study
from experiments.study.notebook import NotebookError, count_entries, plan_in
from experiments.study.option import OptionError, declared_options
from experiments.study.prompt import AutomaticOperator
from experiments.study.provenance import identity, provenance
from experiments.study.results_folder import (
    USUAL,
    ResultFiles,
    make_folder,
    remove_unused,
    require_unfinished,
    set_aside,
)
from experiments.study.session import Ending, Session
from experiments.study.workers import LocalWorkers, Workers, WorkersError
from firmware_host.configuration.file_problems import why_not
from operator_client.status_client import CallRefusedError

NEEDED = ("matplotlib", "pandas", "pyarrow")
EXIT_STATUS = {Ending.DONE: exit_codes.OK, Ending.UNHEALTHY: exit_codes.UNHEALTHY, Ending.REFUSED: exit_codes.REFUSED}
Values = dict[str, Any]
Function = Callable[..., Any]


def run_study(options: argparse.Namespace) -> int:
    """Run the study that the command line names."""
    for module in NEEDED:  # they are reported before the hours of measuring
        if find_spec(module) is None:
            raise ModuleNotFoundError(name=module)
    try:
        return _conduct(options, load_study(options.name))
    except (OptionError, argparse.ArgumentTypeError) as problem:
        complain(str(problem))
        return exit_codes.USAGE
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED


def _conduct(options: argparse.Namespace, module: ModuleType) -> int:
    function = _chosen(options, module)
    values = given_options(options, function)
    defaults = {each.parameter: each.default for each in declared_options(function)}
    simulated = {"simulated": options.simulated} if "simulated" in options else {}
    # every option that the results depend on, as JSON has it
    typed = json.loads(json.dumps(defaults | values | simulated, default=str))
    program = identity(module.__name__)  # reads the sources before minutes of work, in which they may change
    is_new = options.out is None or not options.out.exists()
    files: ResultFiles = getattr(module, "FILES", USUAL)
    results = _open_folder(options, typed, getattr(module, "folder_name", lambda **_: "")(**values), files)
    before = count_entries(results) if (results / files.page).exists() else None
    try:
        status = _run(options, module, partial(function, **values), results, program, typed)
    except (BenchError, EndedError, CallRefusedError, WorkersError, KeyboardInterrupt, OSError) as problem:
        status = _end_early(results, problem)
    finally:
        if is_new:
            remove_unused(results)
    if before == count_entries(results):
        print(f"{results} had every measurement already; they are only evaluated again", file=sys.stderr)
    return status


def _chosen(options: argparse.Namespace, module: ModuleType) -> Function:
    """Return the function that runs. Raises OptionError for options of the other one."""
    study: Function = module.study
    robot: Function | None = getattr(module, "robot", None)
    if has_files(study) or takes_session(study) or (robot is None and options.simulated):
        return study
    if robot is None:
        raise OptionError("robot and muds are those of the simulator: this experiment runs with --simulated only")
    chosen, other = (study, robot) if options.simulated else (robot, study)
    foreign = given_options(options, other).keys() - given_options(options, chosen).keys()
    if not options.simulated and (options.workers or options.cluster):
        foreign |= {"workers"} if options.workers else {"cluster"}
    if foreign:
        where = "without --simulated" if options.simulated else "with --simulated"
        raise OptionError(f"{flag_of(min(foreign))} can only be given {where}")
    return chosen


def _open_folder(options: argparse.Namespace, typed: Values, name: str, files: ResultFiles) -> Path:
    """Return the folder of the results: without --out a new one. Raises NotebookError, OSError.

    A finished study continues with options other than `typed`, such as more trials.
    """
    if options.out is None:
        return make_folder(f"mudskipper-{name or options.name}")
    folder: Path = options.out.resolve() if options.restart else options.out  # the working directory moves too
    if options.restart and (old := set_aside(folder)):
        print(f"the earlier results are in {old} now", file=sys.stderr)
    require_unfinished(folder, options.name, typed, files)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _run(
    options: argparse.Namespace,
    module: ModuleType,
    function: Callable[..., Any],
    results: Path,
    program: Mapping[str, str],
    typed: Values,
) -> int:
    from experiments.study.page import write_result  # matplotlib and pandas are slow to import
    from experiments.study.trials import Trials

    progress = Progress("trials")
    trials: Trials | None = None
    try:
        if takes_session(function.func):  # type: ignore[attr-defined]
            result = function(_session_in(options, results, progress, program))
        else:
            plan = {"experiment": options.name, "simulated": True, **program}
            trials = Trials(results, plan, progress.show, _workers_of(options))
            result = function(trials)
    finally:
        progress.clear()
    simulated = " (simulated)" if typed.get("simulated") else ""
    result = replace(result, title=f"{result.title or f'Experiment: {options.name}'}{simulated}")
    report = (
        {"schema": f"experiment-{options.name}/{getattr(module, 'SCHEMA', 1)}", "experiment": options.name}
        | result.json()
        | ({"simulated": typed["simulated"]} if "simulated" in typed else {})
        | {"provenance": provenance(module.__name__) | {"options": typed, "plan": plan_in(results)}}
    )
    written = write_result(results, result, report, trials.measured if trials else ())
    if options.json:
        print_value(report)
    else:
        print(result.text())
    print(f"written  {', '.join(map(str, written))}", file=sys.stderr)
    return EXIT_STATUS[result.ending]


def _session_in(options: argparse.Namespace, folder: Path, progress: Progress, program: Mapping[str, str]) -> Session:
    prompt = TerminalPrompt(progress.clear)
    if options.simulated:
        operator = AutomaticOperator(prompt.report)
        return Session(folder, operator, progress.show, simulated=True, program=program)
    return Session(folder, prompt, progress.show, getattr(options, "socket", None), program=program)


def _workers_of(options: argparse.Namespace) -> Workers:
    if options.cluster:
        from experiments.study.cluster_workers import ClusterWorkers  # distributed is slow to import, and an extra

        return ClusterWorkers(options.cluster)
    return LocalWorkers(options.workers)


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
    if count_entries(folder):
        complain(f"the measurements so far are in {folder}; the same command with --out {folder} continues from there")
    return status
