"""One measured value of the bench with its unit, its bounds, and the advice for a value outside of them."""

from collections.abc import Iterator
from math import inf, isfinite, nan
from typing import Any, NamedTuple


class BenchReading(NamedTuple):
    what: str
    value: float  # NaN: not measurable, which is never good
    unit: str = ""
    low: float = -inf
    high: float = inf
    advice: str = ""
    left_out: bool = False  # no operator was there: the check neither passes nor fails

    @property
    def good(self) -> bool:
        return bool(self.left_out or self.low <= self.value <= self.high)  # numbers may be numpy's

    @property
    def number_text(self) -> str:
        if self.left_out:
            return "left out"
        return f"{self.value:.4g}" if self.value == self.value else "unknown"

    @property
    def value_text(self) -> str:
        return f"{self.number_text} {self.unit}".strip() if self.value == self.value else self.number_text

    @property
    def bounds_text(self) -> str:
        if isfinite(self.low) and isfinite(self.high):
            exactly = self.low == self.high
            return f"exactly {self.low:.4g}" if exactly else f"{self.low:.4g} to {self.high:.4g}"
        if isfinite(self.low):
            return f"at least {self.low:.4g}"
        return f"at most {self.high:.4g}" if isfinite(self.high) else ""

    @property
    def message(self) -> str:
        advice = f": {self.advice}" if self.advice else ""
        return f"{self.what} is {self.value_text}, must be {self.bounds_text}{advice}."

    @property
    def as_json(self) -> dict[str, Any]:
        """The fields for JSON, with None in place of NaN and infinity."""
        numbers = {"value": self.value, "low": self.low, "high": self.high}
        known = {name: number if isfinite(number) else None for name, number in numbers.items()}
        return {"what": self.what, "unit": self.unit, **known, "good": self.good, "left_out": self.left_out,
                "advice": self.advice}  # fmt: skip


def left_out(what: str) -> BenchReading:
    return BenchReading(what, nan, left_out=True)


BenchReadings = Iterator[BenchReading]
