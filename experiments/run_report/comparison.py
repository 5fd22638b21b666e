"""Differences between runs, mud by mud, with their uncertainty.

Each run is compared with the first one in the muds that both have under the same name. The error that all strides of
one robot share, such as that of its torque constants, moves its runs alike: where both are of the same robot only the
errors of the strides count. A difference is shown where it exceeds two of its standard errors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot

from experiments.reports.coefficient_table import GatheredCoefficient
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.mud_names import mud_key
from experiments.run_report.headline import Headline
from experiments.run_report.mud_results import MudResult
from experiments.run_report.run import Run

SHOWN = 2.0  # standard errors
SPEED = "speed"


@dataclass(frozen=True)
class Difference:
    """One quantity of a mud in another run minus that in the first one: m/s for the speed, else N/m³."""

    run: str
    first_run: str
    mud: str
    quantity: str
    first: float
    other: float
    difference: float
    std_error: float | None  # None where a run has a single value without an error
    like_depths: bool  # the strides of both runs reached the same depths

    @property
    def is_shown(self) -> bool | None:
        """Whether the runs differ; None where the logs do not show it."""
        return None if self.std_error is None else abs(self.difference) > SHOWN * self.std_error


@dataclass(frozen=True)
class ComparedRun:
    run: Run
    headline: Headline


def differences(runs: Sequence[ComparedRun]) -> list[Difference]:
    """Compare every run with the first."""
    first, *others = runs
    return [each for other in others for each in _between(first, other)]


def _between(first: ComparedRun, other: ComparedRun) -> Iterator[Difference]:
    same_robot = first.run.robot == other.run.robot
    in_other = {mud_key(result.mud): result for result in other.headline.muds}
    for before in first.headline.muds:
        after = in_other.get(mud_key(before.mud))
        if after is None:
            continue
        for quantity, (a, a_error), (b, b_error) in _quantities(before, after, same_robot):
            if a is not None and b is not None:
                error = None if a_error is None or b_error is None else hypot(a_error, b_error)
                yield Difference(
                    run=other.run.name,
                    first_run=first.run.name,
                    mud=before.mud,
                    quantity=quantity,
                    first=a,
                    other=b,
                    difference=b - a,
                    std_error=error,
                    like_depths=_overlap(before, after),
                )


def _overlap(before: MudResult, after: MudResult) -> bool:
    return before.shallowest_m <= after.deepest_m and after.shallowest_m <= before.deepest_m


Value = tuple[float | None, float | None]  # with its standard error


def _quantities(before: MudResult, after: MudResult, same_robot: bool) -> Iterator[tuple[str, Value, Value]]:
    yield SPEED, _speed(before), _speed(after)
    for name in COEFFICIENTS:
        a, b = before.both[name], after.both[name]
        if not (a.at_least or b.at_least):
            by_trials = same_robot and a.trials_error is not None and b.trials_error is not None
            yield name, _value(a, by_trials), _value(b, by_trials)


def _speed(result: MudResult) -> Value:
    return result.motion.speed_m_s, result.motion.speed_std_error_m_s


def _value(gathered: GatheredCoefficient, by_trials: bool) -> Value:
    return gathered.value, gathered.trials_error if by_trials else gathered.std_error


def flipper_difference(left: GatheredCoefficient, right: GatheredCoefficient) -> Value:
    """Return right minus left: two flippers have motors, and so torque constants, of their own."""
    if left.value is None or right.value is None or left.at_least or right.at_least:
        return None, None
    errors = (left.std_error, right.std_error)
    return right.value - left.value, None if None in errors else hypot(*(error or 0.0 for error in errors))
