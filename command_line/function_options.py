"""Adds the options that a function declares (experiments/study/option.py) to the parser of its command."""

import argparse
from collections.abc import Callable
from functools import partial
from inspect import Parameter
from pathlib import Path
from typing import Any

from command_line.option_types import above, between, whole
from experiments.study.option import DeclaredOption, OptionError, declared_options

METAVARS = {int: "N", float: "X", Path: "FILE", str: "NAME"}
SHOWN_DEFAULTS = 4  # of a repeatable option


def add_function_options(parser: argparse.ArgumentParser, *functions: Callable[..., Any]) -> None:
    """Add every option of the functions once. An option that is not given is no attribute of the parsed options."""
    declared = {each.parameter: each for function in reversed(functions) for each in declared_options(function)}
    order = dict.fromkeys(each.parameter for function in functions for each in declared_options(function))
    for name in order:
        _add(parser, declared[name])


def given_options(options: argparse.Namespace, function: Callable[..., Any]) -> dict[str, Any]:
    """Return the values that the operator gave to parameters of the function."""
    names = [each.parameter for each in declared_options(function) if hasattr(options, each.parameter)]
    values = {name: getattr(options, name) for name in names}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}


def flag_of(parameter: str) -> str:
    """Return the name of a parameter's option, such as --left-out."""
    return f"--{parameter.replace('_', '-')}"


def _add(parser: argparse.ArgumentParser, declared: DeclaredOption) -> None:
    option, keywords = declared.option, dict[str, Any](help=_help(declared), default=argparse.SUPPRESS)
    if declared.type is bool:
        parser.add_argument(flag_of(declared.parameter), action="store_true", **keywords)
        return
    keywords["type"] = _parser(declared)
    if declared.choices:
        keywords["choices"] = declared.choices
    else:
        keywords["metavar"] = option.metavar or option.unit.upper() or METAVARS.get(declared.type, "VALUE")
    if option.bare is not None:
        keywords |= {"nargs": "?", "const": option.bare}
    if declared.named:
        names = [flag_of(declared.parameter), *([option.also] if option.also else [])]
        action = "append" if declared.repeatable else "store"
        parser.add_argument(*names, dest=declared.parameter, action=action, **keywords)
    else:
        if declared.repeatable:
            keywords["nargs"] = "+"
        parser.add_argument(declared.parameter, **keywords)


def _parser(declared: DeclaredOption) -> Callable[[str], Any]:
    option = declared.option
    if option.parse is not None:
        return partial(_parse, option.parse)
    if option.above is not None:
        return above(option.above, option.high, option.unit)
    if option.low is None or option.high is None:
        return declared.type
    if declared.type is int:
        return whole(int(option.low), int(option.high))
    return between(option.low, option.high, option.unit)


def _parse(parse: Callable[[str], Any], text: str) -> Any:
    try:
        return parse(text)
    except OptionError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


def _help(declared: DeclaredOption) -> str:
    """Return the help with unit and default, as far as it does not name them itself."""
    text, default = declared.option.help, declared.default
    unit = f" {declared.option.unit}".rstrip()
    if declared.repeatable and declared.named:
        text += ", repeatable"
    if "(default" in text or default in (Parameter.empty, None, False, "", ()):
        return text.replace("%", "%%")
    values = default if declared.repeatable else [default]
    texts = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
    shown = ", ".join(texts) if len(texts) <= SHOWN_DEFAULTS else f"{len(texts)} values"
    return f"{text} (default: {shown}{unit})".replace("%", "%%")
