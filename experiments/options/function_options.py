"""Adds the parameters of a function to a parser as options, and calls the function with the parsed values.

This is own code, because the libraries for it take longer to import than `mudskipper status` may take to start: in one
interleaved run a bare interpreter took 32 ms, with argparse 56 ms, with typer 189 ms, cyclopts 225 ms and tyro 231 ms.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, NamedTuple, get_args, get_origin

from experiments.options.option import Option

REQUIRED: Any = object()  # the default of a parameter without one


class Declared(NamedTuple):
    """A parameter that is an option."""

    name: str
    type: Any  # of one value
    option: Option
    default: Any
    is_repeated: bool
    is_positional: bool


def declared_options(function: Callable[..., Any]) -> Iterator[Declared]:
    """Yield every parameter that is annotated with an Option; inspect would take longer to import than all of this."""
    while hasattr(function, "__wrapped__"):
        function = function.__wrapped__
    code = function.__code__
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    positional_defaults = function.__defaults__ or ()
    defaults = dict(zip(names[code.co_argcount - len(positional_defaults) :], positional_defaults, strict=False))
    defaults |= function.__kwdefaults__ or {}
    for index, name in enumerate(names):
        annotation: Any = function.__annotations__[name]
        if get_origin(annotation) is Annotated:
            kind, option = get_args(annotation)
            kind = (
                next(each for each in (*get_args(kind), kind) if each is not NoneType)
                if NoneType in get_args(kind)
                else kind
            )
            is_repeated = get_origin(kind) in (list, Sequence)
            yield Declared(
                name=name,
                type=get_args(kind)[0] if is_repeated else kind,
                option=option,
                default=option.default() if option.default else defaults.get(name, REQUIRED),
                is_repeated=is_repeated,
                is_positional=index < code.co_argcount,
            )


def add_options(parser: argparse.ArgumentParser, function: Callable[..., Any]) -> None:
    """Add the options of a function to a parser."""
    groups: dict[str, Any] = {"": parser}
    for each in declared_options(function):
        alternative = each.option.alternative
        if alternative not in groups:
            groups[alternative] = parser.add_mutually_exclusive_group()
        if each.is_positional:
            groups[alternative].add_argument(each.name, **_keywords(each))
        else:
            names = each.option.names or (f"--{each.name.replace('_', '-')}",)
            groups[alternative].add_argument(*names, dest=each.name, **_keywords(each))


def call_with_options(function: Callable[..., Any], parsed: argparse.Namespace) -> Any:
    """Call a function with the parsed values of its options."""
    values = {each: getattr(parsed, each.name) for each in declared_options(function)}
    return function(**{each.name: each.default if value is None else value for each, value in values.items()})


def _keywords(each: Declared) -> dict[str, Any]:
    """Return the keywords of argparse's `add_argument`."""
    option, is_required = each.option, each.default is REQUIRED
    default = None if each.is_repeated or is_required else each.default  # argparse would append to a default list
    keywords: dict[str, Any] = {"default": default, "help": _help(option.help, default)}
    if each.type is bool:
        return keywords | {"action": "store_true"}
    by_type: dict[Any, Any] = {float: option.parse_number, int: option.parse_whole_number}
    keywords["type"] = option.parse or by_type.get(each.type, each.type)
    keywords["metavar"] = option.metavar or (None if option.choices else _metavar(each))
    keywords["choices"] = tuple(option.choices) or None
    if each.is_positional:
        at_least_none, at_least_one = ("*", "+") if each.is_repeated else ("?", None)
        return keywords | {"nargs": at_least_one if is_required else at_least_none}
    if each.is_repeated:
        keywords["action"] = "append"
    if option.without_value is not None:
        keywords |= {"nargs": "?", "const": option.without_value}
    return keywords | {"required": is_required}


def _metavar(each: Declared) -> str:
    return each.option.unit.upper() or {Path: "FILE", str: "NAME"}.get(each.type, "N")


def _help(text: str, default: Any) -> str:
    """Return the help with the default, where that says something and the text does not name it."""
    if default in (None, False, "", ()) or "default" in text:
        return text
    return f"{text} (default: {'%(default)g' if isinstance(default, float) else '%(default)s'})"
