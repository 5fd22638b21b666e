"""The description of a parameter that is an option of a command line, and the bounds of a number.

A command or a study is a function, and its parameters are its options: `Annotated[float, Option(...)]` gives help, unit
and bounds of one. Parameters before `*` are arguments without a name, such as FILE of `mudskipper log info FILE`.
"""

import argparse
from collections.abc import Callable, Sequence
from math import inf, isfinite, nan
from typing import Any, NamedTuple


class Option(NamedTuple):
    """Describes a parameter, whose type says how it is parsed: a bool is a flag, a list may be given repeatedly."""

    help: str
    metavar: str = ""  # default: FILE, NAME, or the unit
    unit: str = ""
    low: float = -inf
    high: float = inf
    above: float = -inf  # a lower bound that is not allowed itself
    choices: Sequence[str] = ()
    parse: Callable[[str], Any] | None = None  # raises argparse.ArgumentTypeError
    default: Callable[[], Any] | None = None  # computed when a parameter without a default is not given
    without_value: str | None = None  # the value of an option that is given without one
    names: tuple[str, ...] = ()  # default: the parameter's name with hyphens
    alternative: str = ""  # options with the same word here exclude each other

    def parse_number(self, text: str) -> float:
        """Return the number. Raises argparse.ArgumentTypeError outside of the bounds."""
        try:
            value = float(text)
        except ValueError:
            value = nan
        if not (isfinite(value) and self.low <= value <= self.high and value > self.above):
            raise argparse.ArgumentTypeError(f"{text}: must be {self._range('a number')}")
        return value

    def parse_whole_number(self, text: str) -> int:
        """Return the number. Raises argparse.ArgumentTypeError where it is not whole, and outside of the bounds."""
        try:
            value = self.parse_number(text)
        except argparse.ArgumentTypeError:
            value = nan
        if value != value // 1:
            bounds = self._range("")
            raise argparse.ArgumentTypeError(f"{text}: must be a whole number{bounds and ' '}{bounds}")
        return int(value)

    def _range(self, unbounded: str) -> str:
        parts = [f"more than {self.above:.15g}"] if self.above > -inf else []
        if self.low > -inf:
            parts = [f"from {self.low:.15g} to {self.high:.15g}"]
        elif self.high < inf:
            parts.append(f"at most {self.high:.15g}")
        return f"{' and '.join(parts)} {self.unit}".strip() if parts else unbounded
