"""How far the estimates of a log move when its currents come late or early, or some of its rows are missing.

A stride of the disturbed log is compared with the one of the same flipper that begins at the same time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from control.records import Estimate, StrideEstimate
from estimation.estimation_parameters import Method
from experiments.lablogs.lab_trial import (
    DELAY_S,
    MISSING_ROWS,
    SEEDS,
    LabTrial,
    Replays,
    Strides,
    claims_error,
    is_value,
)
from experiments.reports.error_table import COEFFICIENTS

SAME_START_S = 0.2  # missing rows move the start of a stride by a few rows, and a stride takes more than a second
MOVED = 2.0  # claimed errors


class Change(NamedTuple):
    """One value as recorded, and the estimate of the same stride from the disturbed log; None where it is missing."""

    coefficient: str
    recorded: Estimate
    disturbed: Estimate | None

    @property
    def ratio(self) -> float | None:
        """Disturbed over recorded; None where the value was lost."""
        if self.disturbed is None or not is_value(self.disturbed) or self.recorded.value == 0.0:
            return None
        return self.disturbed.value / self.recorded.value

    @property
    def moved_errors(self) -> float | None:
        """The change in claimed errors; None where the value was lost."""
        if self.disturbed is None or not is_value(self.disturbed) or not claims_error(self.recorded):
            return None
        return abs(self.disturbed.value - self.recorded.value) / self.recorded.std_error


@dataclass(frozen=True)
class Ratios:
    """Disturbed over recorded values. `lost`: values that became invalid or a bound."""

    median: float | None
    smallest: float | None
    largest: float | None
    n: int
    lost: int


@dataclass(frozen=True)
class Moves:
    """The fraction of values that moved by more than MOVED claimed errors."""

    moved: float | None
    n: int
    lost: int


@dataclass(frozen=True)
class Sensitivity:
    """The effect of each disturbance, by coefficient."""

    current_late: dict[str, Ratios]
    current_early: dict[str, Ratios]
    rows_missing: dict[str, Moves]


@dataclass(frozen=True)
class SensitivityReport(Sensitivity):
    """The effects over all logs in mud, and over those of each group."""

    groups: dict[str, Sensitivity]
    delay_s: float = DELAY_S
    missing_fraction: float = MISSING_ROWS
    seeds: Sequence[int] = SEEDS


def changes(
    trials: Sequence[LabTrial], method: Method, disturbed: Callable[[Replays], Sequence[Strides]]
) -> list[Change]:
    """Return the changes of all values; `disturbed` selects the disturbed replays."""
    return [
        Change(name, getattr(stride, name), None if other is None else getattr(other, name))
        for trial in trials
        for others in disturbed(trial.replays[method])
        for stride in trial.replays[method].recorded
        for other in (_same_stride(stride, others),)
        for name in COEFFICIENTS
        if is_value(getattr(stride, name))
    ]


def _same_stride(stride: StrideEstimate, others: Strides) -> StrideEstimate | None:
    own = [other for other in others if other.flipper == stride.flipper]
    near = min(own, key=lambda other: abs(other.t_start_s - stride.t_start_s), default=None)
    return near if near is not None and abs(near.t_start_s - stride.t_start_s) <= SAME_START_S else None


def late_changes(trials: Sequence[LabTrial], method: Method) -> list[Change]:
    return changes(trials, method, lambda replays: [replays.current_late])


def early_changes(trials: Sequence[LabTrial], method: Method) -> list[Change]:
    return changes(trials, method, lambda replays: [replays.current_early])


def missing_changes(trials: Sequence[LabTrial], method: Method) -> list[Change]:
    return changes(trials, method, lambda replays: replays.rows_missing)


def sensitivity(trials: Sequence[LabTrial], method: Method) -> Sensitivity:
    late, early, missing = (
        _by_coefficient(find(trials, method)) for find in (late_changes, early_changes, missing_changes)
    )
    return Sensitivity(
        {name: _ratios(found) for name, found in late.items()},
        {name: _ratios(found) for name, found in early.items()},
        {name: _moves(found) for name, found in missing.items()},
    )


def _by_coefficient(found: Sequence[Change]) -> dict[str, list[Change]]:
    return {name: [change for change in found if change.coefficient == name] for name in COEFFICIENTS}


def _ratios(found: Sequence[Change]) -> Ratios:
    ratios = [change.ratio for change in found if change.ratio is not None]
    lost = len(found) - len(ratios)
    if not ratios:
        return Ratios(None, None, None, 0, lost)
    median, smallest, largest = (round(float(value), 4) for value in (np.median(ratios), min(ratios), max(ratios)))
    return Ratios(median, smallest, largest, len(ratios), lost)


def _moves(found: Sequence[Change]) -> Moves:
    moves = [change.moved_errors for change in found if change.moved_errors is not None]
    moved = round(float(np.mean([move > MOVED for move in moves])), 4) if moves else None
    return Moves(moved, len(moves), len(found) - len(moves))
