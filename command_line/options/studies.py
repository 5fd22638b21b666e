"""The command of every study in `mudskipper experiment`, with the options that its function declares.

A study is a module of experiments/studies with a function `study`. The type of its first parameter says what it runs:
`Trials` are rows on the workers and need --simulated, a `Session` is a robot with its operator, or a simulated one.
A study on rows may have a second function, `robot`, which takes a Session and runs without --simulated. A study of
files has them as unnamed arguments, and no robot. A module with HAS_ROBOT = False has an operator and no robot.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from inspect import signature
from types import ModuleType
from typing import Any, get_type_hints

from command_line.function_options import add_function_options
from command_line.options.shared import add_json, add_socket
from experiments.study.catalogue import load_study, study_texts
from experiments.study.option import Option, declared_options
from experiments.study.session import Session
from experiments.study.values import folder


def add_experiment(experiment: argparse.ArgumentParser) -> None:
    """Add the command of every study."""
    names = experiment.add_subparsers(dest="name", required=True, metavar="name")
    for name, text in study_texts().items():
        command = names.add_parser(
            name, help=text.partition("\n")[0], description=text, target=partial(_add_options, name)
        )
        command.set_defaults(function="experiments.studies.run_study")


def add_calibrate(command: argparse.ArgumentParser) -> None:
    """Add the options of the study that is a command of its own."""
    _add_options("calibrate", command)
    command.set_defaults(function="experiments.studies.run_study", name="calibrate")


def _add_options(name: str, command: argparse.ArgumentParser) -> None:
    with suppress(ModuleNotFoundError):  # of an extra; the command itself says which
        module = load_study(name)
        functions = list(_functions(module))
        add_function_options(command, *functions)
        if not has_files(module.study):
            command.add_argument("--simulated", action="store_true", help="robot and muds are simulated")
        if any(takes_session(function) for function in functions) and getattr(module, "HAS_ROBOT", True):
            add_socket(command)
        if not takes_session(module.study):
            workers = command.add_mutually_exclusive_group()
            workers.add_argument(
                "--workers",
                type=Option("processes here", low=1, high=1000).parse_whole_number,
                metavar="N",
                help="processes here (default: one for each processor)",
            )
            workers.add_argument(
                "--cluster", metavar="ADDRESS", help="of a Dask scheduler, whose workers run the trials instead"
            )
    add_json(command)
    command.add_argument(
        "--out", type=folder, metavar="DIR", help="for the results; continues there (default: a new mudskipper-NAME)"
    )
    command.add_argument(
        "--restart", action="store_true", help="begin again in that folder; its earlier results are kept as DIR-old"
    )


def _functions(module: ModuleType) -> Iterator[Callable[..., Any]]:
    yield module.study
    if hasattr(module, "robot"):
        yield module.robot


def takes_session(function: Callable[..., Any]) -> bool:
    return get_type_hints(function)[next(iter(signature(function).parameters))] is Session


def has_files(function: Callable[..., Any]) -> bool:
    return not all(option.named for option in declared_options(function))
