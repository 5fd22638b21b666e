"""Measures one check of the bench, again where late ticks or messages may have disturbed it."""

from collections.abc import Callable
from typing import Concatenate, NamedTuple, ParamSpec

from experiments.bench.lateness import Lateness
from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import BenchError

MOST_MEASURED = 3  # attempts for one check
P = ParamSpec("P")


class MeasuredCheck(NamedTuple):
    readings: list[BenchReading]  # of the last attempt
    repeats: list[str]  # what was out of bounds in the attempts before it
    problem: str  # what is out of bounds, with what to do; empty where nothing is


class UnfinishedCheckError(BenchError):
    """The robot ended a check; `readings` are those before."""

    def __init__(self, message: str, readings: list[BenchReading]) -> None:
        super().__init__(message)
        self.readings = readings


def measure_check(
    test_rig: TestRig, check: Callable[Concatenate[TestRig, P], BenchReadings], *arguments: P.args, **named: P.kwargs
) -> MeasuredCheck:
    """Raises UnfinishedCheckError where a fault ends it."""
    repeats: list[str] = []
    for left in reversed(range(MOST_MEASURED)):
        test_rig.lateness = Lateness()
        readings: list[BenchReading] = []
        try:
            readings.extend(check(test_rig, *arguments, **named))
        except BenchError as problem:
            raise UnfinishedCheckError(f"{problem} {test_rig.lateness.message}".rstrip(), readings) from None
        late = test_rig.lateness.message
        wrong = [reading.message for reading in readings if not reading.good]
        if not (wrong and late and left):
            break
        repeats.append(" ".join([*wrong, late]))
    return MeasuredCheck(readings, repeats, "\n".join([*wrong, late]).rstrip() if wrong else "")
