"""Declares an option where its value is used: in the annotation of a function's parameter.

    def study(trials: Trials, *, seeds: Annotated[int, Option("walks of each point", low=1, high=1000)] = 2) -> Result:

The parameter's name, type and default are those of the option. A tuple is a repeatable option, a Literal lists the
choices, a bool is a flag. A parameter before the star is an argument without a name. Studies and the commands of
`mudskipper` are declared like this.
"""

from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator, Sequence
from math import inf, isfinite, nan
from types import NoneType
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

REQUIRED: Any = object()  # the default of an option that must be given


class OptionError(ArgumentTypeError):
    """Options that do not fit together, or a value that cannot be used; the text says which, and what is allowed."""


class Option(NamedTuple):
    """What a parameter means, and which values it may have."""

    help: str
    low: float = -inf
    high: float = inf
    unit: str = ""
    metavar: str = ""
    also: str = ""  # a second name, such as "--seeds"
    keyed: bool = False  # each value of a tuple is a key and its value, and a key counts once
    joined: bool = False  # one text has all values of a tuple, such as A,B
    parse: Callable[[str], Any] | None = None  # the text of a value, or of all joined ones; raises OptionError
    above: float = -inf  # a lower bound that is not allowed itself
    choices: Sequence[str] = ()  # that are not known before the program runs, as those of a Literal are
    default: Callable[[], Any] | None = None  # computes it where the command line does not give a value
    without_value: str | None = None  # the value of an option that is given without one
    name: str = ""  # where it differs from the parameter's
    alternative: str = ""  # options with the same word here exclude each other
    offers: str = ""  # what a shell's completion offers for each joint, such as "{joint}="

    def parse_number(self, text: str) -> float:
        """Return the number, which may be followed by the option's own unit.

        Raises argparse.ArgumentTypeError for another text or unit, and outside of the bounds.
        """
        try:
            value = float(text.strip().removesuffix(self.unit))
        except ValueError:
            value = nan
        if not isfinite(value):
            parts = (f"a number in {self.unit}" if self.unit else "a number", self._bounds())
            raise ArgumentTypeError(f"{text}: must be {', '.join(filter(None, parts))}")
        if not (self.low <= value <= self.high and value > self.above):
            raise ArgumentTypeError(f"{text}: must be {self._bounds()}")
        return value

    def parse_whole_number(self, text: str) -> int:
        """Return the number. Raises argparse.ArgumentTypeError where it is not whole, and outside of the bounds."""
        try:
            value = self.parse_number(text)
        except ArgumentTypeError:
            value = nan
        if value != value // 1:  # also NaN
            raise ArgumentTypeError(f"{text}: must be a whole number {self._bounds()}".rstrip())
        return int(value)

    def _bounds(self) -> str:
        parts = [f"more than {self.above:.15g}"] if self.above > -inf else []
        if self.low > -inf:
            parts.append(f"from {self.low:.15g} to {self.high:.15g}")
        elif self.high < inf:
            parts.append(f"at most {self.high:.15g}")
        return f"{' and '.join(parts)} {self.unit}".strip() if parts else ""


class DeclaredOption(NamedTuple):
    """An option as a parser needs it."""

    parameter: str
    option: Option
    type: type  # of one value
    choices: tuple[Any, ...]  # empty: any
    default: Any  # REQUIRED where a value must be given
    repeatable: bool
    named: bool  # as --name


def declared_options(function: Callable[..., Any]) -> Iterator[DeclaredOption]:
    """Yield the options of a function: its annotated parameters, in their order.

    They are read without `inspect`, which takes longer to import than `mudskipper status` to run. Raises TypeError
    where annotations are text.
    """
    while hasattr(function, "__wrapped__"):
        function = function.__wrapped__
    code, positional = function.__code__, function.__defaults__ or ()
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    first = code.co_argcount - len(positional)
    defaults = dict(zip(names[first:], positional, strict=False)) | (function.__kwdefaults__ or {})
    for index, name in enumerate(names):
        annotation: Any = function.__annotations__.get(name)
        if isinstance(annotation, str):
            raise TypeError(
                f"{function.__module__}: its annotations are text and declare no options: remove 'from __future__ "
                "import annotations'"
            )
        if get_origin(annotation) is Annotated:
            kind, option = get_args(annotation)
            yield _declared(name, kind, option, defaults.get(name, REQUIRED), index >= code.co_argcount)


def _declared(name: str, kind: Any, option: Option, default: Any, named: bool) -> DeclaredOption:
    if NoneType in get_args(kind):
        kind = next(each for each in get_args(kind) if each is not NoneType)
    repeatable = get_origin(kind) is tuple and get_args(kind)[-1] is Ellipsis and not option.joined
    kind = get_args(kind)[0] if repeatable else kind
    choices = get_args(kind) if get_origin(kind) is Literal else tuple(option.choices)
    return DeclaredOption(
        parameter=name,
        option=option,
        type=type(choices[0]) if choices else kind,
        choices=choices,
        default=option.default or default,
        repeatable=repeatable,
        named=named,
    )
