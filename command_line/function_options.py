"""Adds the options that functions declare (experiments/study/option.py) to the parser of their command.

This is own code, because the libraries for it take longer to import than `mudskipper status` may take to start: in one
interleaved run a bare interpreter took 32 ms, with argparse 56 ms, with typer 189 ms, cyclopts 225 ms and tyro 231 ms.
"""

import argparse
from collections.abc import Callable, Sequence
from typing import Any

from command_line.errors import usage_error
from command_line.json_output import JSON, Answer
from experiments.study.option import REQUIRED, DeclaredOption, Option, declared_options

METAVARS = {"int": "N", "float": "X", "Path": "FILE", "str": "NAME"}  # by name: pathlib is slow to import
SHOWN_DEFAULTS = 4  # of a repeatable option


def add_function_options(parser: argparse.ArgumentParser, *functions: Callable[..., Any]) -> None:
    """Add every option of the functions once. An option that is not given is no attribute of the parsed options."""
    declared: dict[str, DeclaredOption] = {}
    for function in functions:
        for each in declared_options(function):
            declared.setdefault(each.parameter, each)
    groups: dict[str, Any] = {"": parser}
    for each in declared.values():
        alternative = each.option.alternative
        if alternative not in groups:
            groups[alternative] = parser.add_mutually_exclusive_group()
        if each.named:
            names = [each.option.name or flag_of(each.parameter), *filter(None, [each.option.also])]
            action = groups[alternative].add_argument(*names, dest=each.parameter, **_keywords(each))
        else:
            action = groups[alternative].add_argument(each.parameter, **_keywords(each))
        action.offers = each.option.offers  # for the completion of shells
    answers = any(function.__annotations__.get("return") is Answer for function in functions)
    if answers and "json" not in declared:
        parser.add_argument(JSON, action="store_true", help="print JSON for programs")


class StoreOnce(argparse.Action):
    """Refuses a second value, which would replace the first one in silence."""

    def __call__(self, _: object, options: argparse.Namespace, value: Any, __: object = None) -> None:
        first = getattr(options, self.dest, self.default)
        if first is not self.default:
            raise argparse.ArgumentError(self, f"is given twice, as {first} and {value}; give it once")
        setattr(options, self.dest, value)


def given_options(options: argparse.Namespace, function: Callable[..., Any]) -> dict[str, Any]:
    """Return the values that the operator gave to parameters of the function, and computed defaults."""
    given = {}
    for each in declared_options(function):
        value, default = getattr(options, each.parameter, None), each.option.default
        if value is not None:
            value = default() if default and value is default else value
            given[each.parameter] = tuple(value) if isinstance(value, list) else value
        if value and each.option.keyed:
            _refuse_repeated_key(value)
    return given


def _refuse_repeated_key(pairs: Sequence[tuple[str, Any]]) -> None:
    keys = [key for key, _ in pairs]
    if twice := next((key for key in keys if keys.count(key) > 1), ""):
        raise usage_error(f"{twice} is given twice; give it once")


def flag_of(parameter: str) -> str:
    """Return the name of a parameter's option, such as --left-out."""
    return f"--{parameter.replace('_', '-')}"


def _keywords(declared: DeclaredOption) -> dict[str, Any]:
    """Return the keywords of argparse's `add_argument`."""
    option, is_required = declared.option, declared.default is REQUIRED
    keywords: dict[str, Any] = {"help": _help(declared), "default": option.default or argparse.SUPPRESS}
    if declared.type is bool:
        return keywords | {"action": "store_true"}
    keywords["type"] = _parser(declared.type, option)
    if declared.choices:
        keywords |= {"choices": declared.choices, "metavar": option.metavar or None}
    else:
        keywords["metavar"] = option.metavar or option.unit.upper() or METAVARS.get(declared.type.__name__, "VALUE")
    if not declared.named:
        at_least_none, at_least_one = ("*", "+") if declared.repeatable else ("?", None)
        # argparse would parse a default of text, SUPPRESS too
        return keywords | {"nargs": at_least_one if is_required else at_least_none, "default": None}
    keywords["action"] = "append" if declared.repeatable else StoreOnce
    if option.without_value is not None:
        keywords |= {"nargs": "?", "const": option.without_value}
    return keywords | {"required": is_required}


def _parser(kind: type, option: Option) -> Callable[[str], Any]:
    by_type: dict[type, Callable[[str], Any]] = {float: option.parse_number, int: option.parse_whole_number}
    return option.parse or by_type.get(kind, kind)


def _help(declared: DeclaredOption) -> str:
    """Return the help with unit and default, as far as it does not name them itself."""
    text, default = declared.option.help, declared.default
    unit = f" {declared.option.unit}".rstrip()
    if declared.repeatable and declared.named:
        text += ", repeatable"
    if "(default" in text or default in (REQUIRED, None, False, "", ()):
        return text.replace("%", "%%")
    values = default if declared.repeatable else [default]
    texts = [f"{value:g}" if isinstance(value, float) else str(value) for value in values]
    shown = f"{', '.join(texts)}{unit}" if len(texts) <= SHOWN_DEFAULTS else f"{len(texts)} values"
    return f"{text} (default: {shown})".replace("%", "%%")
