"""Runs a study from the command line: its folder before it, its page, numbers and exit status after it."""

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
from command_line.experiments.conduct import (
    EXIT_STATUS,
    end_early,
    open_folder,
    print_written,
    refuse,
    run_with_progress,
    session_in,
)
from command_line.function_options import flag_of, given_options
from command_line.json_output import print_value
from command_line.options.studies import has_files, takes_session
from command_line.screen import Progress, complain
from experiments.robot.bench_errors import BenchError, EndedError
from experiments.study.catalogue import load_study
from experiments.study.notebook import NotebookError, count_entries, plan_in
from experiments.study.option import OptionError, declared_options
from experiments.study.provenance import identity, provenance
from experiments.study.results_folder import PAGE, remove_unused
from experiments.study.workers import LocalWorkers, Workers, WorkersError
from firmware_host.configuration.file_problems import ConfigurationError
from operator_client.status_client import CallRefusedError

NEEDED = ("matplotlib", "pandas", "pyarrow")
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
        return refuse(str(problem))
    except NotebookError as problem:
        complain(str(problem))
        return exit_codes.REFUSED
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION


def _conduct(options: argparse.Namespace, module: ModuleType) -> int:
    function = _chosen(options, module)
    values = given_options(options, function)
    typed = _effective(function, values, options)
    program = identity(module.__name__)  # reads the sources before minutes of work, in which they may change
    is_new = options.out is None or not options.out.exists()
    results = open_folder(options, typed, getattr(module, "folder_name", lambda **_: "")(**values))
    before = count_entries(results) if (results / PAGE).exists() else None
    try:
        status = _run(options, module, partial(function, **values), results, program, typed)
    except (BenchError, EndedError, CallRefusedError, WorkersError, KeyboardInterrupt, OSError) as problem:
        status = end_early(results, problem)
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


def _effective(function: Callable[..., Any], values: Values, options: argparse.Namespace) -> Values:
    """Return every option that the results depend on with its value, as JSON has it."""
    defaults = {each.parameter: each.default for each in declared_options(function)}
    simulated = {"simulated": options.simulated} if "simulated" in options else {}
    return dict(json.loads(json.dumps(defaults | values | simulated, default=str)))


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

    def run(progress: Progress) -> tuple[Any, Trials | None]:
        if takes_session(function.func):  # type: ignore[attr-defined]
            return function(session_in(options, results, progress, program)), None
        plan = {"experiment": options.name, "simulated": True, **program}
        trials = Trials(results, plan, progress.show, _workers_of(options))
        return function(trials), trials

    result, trials = run_with_progress("trials", run)
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
    print_written(written)
    return EXIT_STATUS[result.ending]


def _workers_of(options: argparse.Namespace) -> Workers:
    if options.cluster:
        from experiments.study.cluster_workers import ClusterWorkers  # distributed is slow to import, and an extra

        return ClusterWorkers(options.cluster)
    return LocalWorkers(options.workers)
