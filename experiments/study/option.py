"""Declares an option where its value is used: in the annotation of a function's parameter.

    def study(trials: Trials, *, seeds: Annotated[int, Option("walks of each point", low=1, high=1000)] = 2) -> Result:

The parameter's name, type and default are those of the option. A tuple is a repeatable option, a Literal lists the
choices, a bool is a flag. A parameter before the star is an argument without a name.
"""

from collections.abc import Callable
from inspect import Parameter, signature
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints


class OptionError(Exception):
    """Options that do not fit together, or a value that cannot be used; the text says which, and what is allowed."""


class Option(NamedTuple):
    """What a parameter means, and which values it may have."""

    help: str
    low: float | None = None
    high: float | None = None
    above: float | None = None  # instead of `low`, where that value itself is not allowed
    unit: str = ""
    metavar: str = ""
    bare: str | None = None  # the value of an option that is given without one
    also: str = ""  # a second name, such as "--seeds"
    parse: Callable[[str], Any] | None = None  # the text of a value; raises OptionError


class DeclaredOption(NamedTuple):
    """An option as a parser needs it."""

    parameter: str
    option: Option
    type: type  # of one value
    choices: tuple[Any, ...]  # empty: any
    default: Any  # Parameter.empty where a value must be given
    repeatable: bool
    named: bool  # as --name


def declared_options(function: Callable[..., Any]) -> list[DeclaredOption]:
    """Return the options of a function: its annotated parameters, in their order."""
    hints = get_type_hints(function, include_extras=True)
    return [
        _declared(parameter, *get_args(hints[name]))
        for name, parameter in signature(function).parameters.items()
        if get_origin(hints[name]) is Annotated
    ]


def _declared(parameter: Parameter, kind: Any, option: Option) -> DeclaredOption:
    if get_origin(kind) in (Union, UnionType):
        kind = next(each for each in get_args(kind) if each is not type(None))
    repeatable = get_origin(kind) is tuple and get_args(kind)[-1] is Ellipsis
    kind = get_args(kind)[0] if repeatable else kind
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    return DeclaredOption(
        parameter=parameter.name,
        option=option,
        type=type(choices[0]) if choices else kind,
        choices=choices,
        default=parameter.default,
        repeatable=repeatable,
        named=parameter.kind is Parameter.KEYWORD_ONLY,
    )
