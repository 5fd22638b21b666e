"""Runs a study from the command line: folder, progress and prompts before it, page, numbers and exit status after it.

A study is a module of experiments/studies with a function `study`. The type of its first parameter says what it runs:
`Trials` are rows on the workers and need --simulated, a `Session` is a robot with its operator, or a simulated one.
A study on rows may have a second function, `robot`, which takes a Session and runs without --simulated. A study of
files has them as unnamed arguments, and no robot. A module with HAS_ROBOT = False has an operator and no robot.

An interrupted experiment stops its robot first. Its folder holds the trials that it measured, and the same command
continues from there. Every report carries what computed it.
"""

import argparse
import json as json_text  # `json` is an option
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, NamedTuple, get_type_hints

from command_line import exit_codes
from command_line.experiments.terminal_prompt import TerminalPrompt
from command_line.function_options import flag_of, given_options
from command_line.json_output import print_value
from command_line.screen import Progress, complain
from command_line.shared_options import Json, Socket
from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError, EndedError
from experiments.study.catalogue import load_study, study_texts
from experiments.study.notebook import NotebookError, count_entries, plan_in
from experiments.study.option import Option, OptionError, declared_options
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
from experiments.study.values import folder
from experiments.study.workers import Workers, WorkersError, run_locally
from firmware_host.configuration.file_problems import why_not
from operator_client.status_client import CallRefusedError

NEEDED = ("matplotlib", "pandas", "pyarrow")
EXIT_STATUS = {Ending.DONE: exit_codes.OK, Ending.UNHEALTHY: exit_codes.UNHEALTHY, Ending.REFUSED: exit_codes.REFUSED}
END_STATUS: Mapping[type[BaseException], int] = {
    DaemonLostError: exit_codes.NO_DAEMON,
    AccessDeniedError: exit_codes.NOT_PERMITTED,
    KeyboardInterrupt: exit_codes.INTERRUPTED,
    WorkersError: exit_codes.UNHEALTHY,
    OSError: exit_codes.UNHEALTHY,  # such as a full disk
}
Values = dict[str, Any]
Function = Callable[..., Any]


class StudyCommand(NamedTuple):
    """The command of one study."""

    name: str

    def functions(self) -> Iterator[Function]:
        """Yield the functions that declare its options: its own, and those of this module that it needs."""
        module = load_study(self.name)
        own = [module.study, *filter(None, [getattr(module, "robot", None)])]
        yield from own
        if not has_files(module.study):
            yield chosen_function
        if any(map(takes_session, own)) and getattr(module, "HAS_ROBOT", True):
            yield make_session
        if not takes_session(module.study):
            yield make_workers
        yield write_page
        yield open_folder

    def run(self, options: argparse.Namespace) -> int:
        return run_study(self.name, options)


CALIBRATE = StudyCommand("calibrate")  # which is a command of its own


def find_commands() -> dict[str, tuple[StudyCommand, str]]:
    """Return every study of `mudskipper experiment` with its text."""
    return {name: (StudyCommand(name), text) for name, text in study_texts().items()}


def takes_session(function: Function) -> bool:
    return get_type_hints(function)[next(iter(signature(function).parameters))] is Session


def has_files(function: Function) -> bool:
    return not all(option.named for option in declared_options(function))


def run_study(name: str, options: argparse.Namespace) -> int:
    """Run a study with the options that its functions declare."""
    for module in NEEDED:  # they are reported before the hours of measuring
        if find_spec(module) is None:
            raise ModuleNotFoundError(name=module)
    try:
        return _conduct(name, options, load_study(name))
    except (OptionError, argparse.ArgumentTypeError) as problem:
        complain(str(problem))
        return exit_codes.USAGE
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED


def _conduct(name: str, options: argparse.Namespace, module: ModuleType) -> int:
    function = chosen_function(module, options, **given_options(options, chosen_function))
    values = given_options(options, function)
    defaults = {each.parameter: each.default for each in declared_options(function)}
    simulated = {} if has_files(module.study) else {"simulated": False} | given_options(options, chosen_function)
    # every option that the results depend on, as JSON has it
    typed = json_text.loads(json_text.dumps(defaults | values | simulated, default=str))
    program = identity(module.__name__)  # reads the sources before minutes of work, in which they may change
    files: ResultFiles = getattr(module, "FILES", USUAL)
    called = getattr(module, "folder_name", lambda **_: "")(**values)
    results, is_new = open_folder(name, called, typed, files, **given_options(options, open_folder))
    before = count_entries(results) if (results / files.page).exists() else None
    try:
        status = _run(name, options, module, partial(function, **values), results, program, typed)
        if before == count_entries(results):
            print(f"{results} had every measurement already; they are only evaluated again", file=sys.stderr)
    except (BenchError, EndedError, CallRefusedError, WorkersError, KeyboardInterrupt, OSError) as problem:
        status = _end_early(results, problem)
    finally:
        if is_new:
            remove_unused(results)
    return status


def chosen_function(
    module: ModuleType,
    options: argparse.Namespace,
    *,
    simulated: Annotated[bool, Option("robot and muds are simulated")] = False,
) -> Function:
    """Return the function that runs. Raises OptionError for options of the other one."""
    study: Function = module.study
    robot: Function | None = getattr(module, "robot", None)
    if has_files(study) or takes_session(study) or (robot is None and simulated):
        return study
    if robot is None:
        raise OptionError("robot and muds are those of the simulator: this experiment runs with --simulated only")
    chosen, other = (study, robot) if simulated else (robot, study)
    foreign = given_options(options, other).keys() - given_options(options, chosen).keys()
    if not simulated:
        foreign |= given_options(options, make_workers).keys()
    if foreign:
        where = "without --simulated" if simulated else "with --simulated"
        raise OptionError(f"{flag_of(min(foreign))} can only be given {where}")
    return chosen


def open_folder(
    name: str,
    called: str,
    typed: Values,
    files: ResultFiles,
    *,
    out: Annotated[
        Path | None,
        Option("for the results; continues there (default: a new mudskipper-NAME)", metavar="DIR", parse=folder),
    ] = None,
    restart: Annotated[bool, Option("begin again in that folder; its earlier results are kept as DIR-old")] = False,
) -> tuple[Path, bool]:
    """Return the folder of the results, and whether it is new: without `out` it is. Raises NotebookError, OSError.

    A finished study continues with options other than `typed`, such as more trials.
    """
    if out is None:
        return make_folder(f"mudskipper-{called or name}"), True
    is_new = not out.exists()
    results = out.resolve() if restart else out  # the working directory moves too
    if restart and (old := set_aside(results)):
        print(f"the earlier results are in {old} now", file=sys.stderr)
    require_unfinished(results, name, typed, files)
    results.mkdir(parents=True, exist_ok=True)
    return results, is_new


def _run(
    name: str,
    options: argparse.Namespace,
    module: ModuleType,
    function: partial[Any],
    results: Path,
    program: Mapping[str, str],
    typed: Values,
) -> int:
    from experiments.study.trials import Trials  # matplotlib and pandas are slow to import

    progress = Progress("trials")
    trials: Trials | None = None
    try:
        if takes_session(function.func):
            given = {"simulated": typed.get("simulated", False), "socket": None} | given_options(options, make_session)
            result = function(make_session(results, progress, program, **given))
        else:
            plan = {"experiment": name, "simulated": True, **program}
            workers = make_workers(**given_options(options, make_workers))
            trials = Trials(results, plan, progress.show, workers)
            result = function(trials)
    finally:
        progress.clear()
    simulated = {key: value for key, value in typed.items() if key == "simulated"}
    marked = " (simulated)" if simulated.get("simulated") else ""
    result = replace(result, title=f"{result.title or f'Experiment: {name}'}{marked}")
    end = {"options": typed, "plan": plan_in(results), "ending": result.ending.name.lower()}
    report = (
        {"schema": f"experiment-{name}/{getattr(module, 'SCHEMA', 1)}", "experiment": name}
        | result.json()
        | simulated
        | {"provenance": provenance(module.__name__) | end}
    )
    rows = trials.measured if trials else ()
    return write_page(results, result, report, rows, **given_options(options, write_page))


def write_page(results: Path, result: Any, report: Values, rows: Any, *, json: Json = False) -> int:
    """Write page, pictures and numbers, print what was found, and return the exit status."""
    from experiments.study.page import write_result  # matplotlib and pandas are slow to import

    written = write_result(results, result, report, rows)
    if json:
        print_value(report)
    else:
        print(result.text())
    print(f"written  {', '.join(map(str, written))}", file=sys.stderr)
    return EXIT_STATUS[result.ending]


def make_session(
    results: Path, progress: Progress, program: Mapping[str, str], simulated: bool, *, socket: Socket
) -> Session:
    """Return the surroundings of a run; `socket` is None where there is no robot."""
    prompt = TerminalPrompt(progress.clear)
    if simulated:
        operator = AutomaticOperator(prompt.report)
        return Session(results, operator, progress.show, simulated=True, program=program)
    return Session(results, prompt, progress.show, Path(socket) if socket else None, program=program)


def make_workers(
    *,
    workers: Annotated[
        int | None,
        Option("processes here (default: one for each processor)", low=1, high=1000, alternative="workers"),
    ] = None,
    cluster: Annotated[
        str | None,
        Option("of a Dask scheduler, whose workers run the trials instead", metavar="ADDRESS", alternative="workers"),
    ] = None,
) -> Workers:
    if cluster:
        from experiments.study.cluster_workers import run_on_cluster  # distributed is slow to import, and an extra

        return partial(run_on_cluster, address=cluster)
    return partial(run_locally, processes=workers)


def _end_early(folder: Path, problem: BaseException) -> int:
    complain(_explain_end(folder, problem))
    if count_entries(folder):
        complain(f"the measurements so far are in {folder}; the same command with --out {folder} continues from there")
    return next((status for kind, status in END_STATUS.items() if isinstance(problem, kind)), exit_codes.REFUSED)


def _explain_end(folder: Path, problem: BaseException) -> str:
    if isinstance(problem, KeyboardInterrupt):
        return "interrupted"
    return why_not(problem, folder) if isinstance(problem, OSError) else str(problem)
