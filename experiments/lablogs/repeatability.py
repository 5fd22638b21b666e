"""How well trials in one mud repeat, and whether their scatter agrees with the errors that they claim.

Each trial is a list of one coefficient's estimates: the first stroke in fresh mud, then the later ones in its hole. A
hole weakens with every stroke, so later strokes are compared after their trial's mean and the mean of their number are
removed from ln k: that decline is mud, not error.

chi is sqrt(chi² / degrees of freedom) of the scatter in claimed errors: 1 where the claimed errors are right, 2 where
they are half of the true ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import fsum, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.records import Estimate
from experiments.lablogs.lab_trial import claims_error, is_value

Floats = NDArray[np.float64]
Strokes = Sequence[Estimate]  # one coefficient's estimates of one trial, in their order


class Scatter(NamedTuple):
    """Deviations in units of their claimed errors."""

    deviations: tuple[float, ...] = ()
    dof: int = 0

    @property
    def chi(self) -> float | None:
        return sqrt(fsum(deviation**2 for deviation in self.deviations) / self.dof) if self.dof > 0 else None

    def joined(self, other: Scatter) -> Scatter:
        return Scatter(self.deviations + other.deviations, self.dof + other.dof)


class Additive(NamedTuple):
    """A table of trials and stroke numbers, fitted by one mean for each of both."""

    trial_effects: Floats
    residuals: Floats  # of the known cells
    dof: int
    connected: bool  # the trials can be compared with each other through strokes that they share


def first_values(trials: Sequence[Strokes]) -> list[Estimate]:
    """Return the first stroke of each trial that has a value there."""
    return [strokes[0] for strokes in trials if strokes and is_value(strokes[0])]


def coefficient_of_variation(values: Sequence[float]) -> float | None:
    """Return the sample standard deviation over the mean; None for fewer than two values."""
    mean = float(np.mean(values)) if len(values) > 1 else 0.0
    return float(np.std(values, ddof=1)) / mean if mean > 0.0 else None


def later_levels(trials: Sequence[Strokes]) -> list[float]:
    """Return each trial's geometric mean over its later strokes, the same number of them in every trial.

    Where values are missing, the mean is that of a complete trial with the same decline. Empty where trials share no
    stroke number.
    """
    later = [strokes[1:] for strokes in trials if len(strokes) > 1]
    common = min((len(strokes) for strokes in later), default=0)
    logs, _ = _log_table([strokes[:common] for strokes in later])
    logs = logs[np.isfinite(logs).any(axis=1)]
    if len(logs) < 2:
        return []
    fit = _fit_additive(logs, np.ones_like(logs))
    return [float(level) for level in np.exp(fit.trial_effects)] if fit.connected else []


def scatter_between_trials(trials: Sequence[Strokes]) -> Scatter:
    """Compare first strokes with their weighted mean."""
    first = list(filter(claims_error, first_values(trials)))
    if len(first) < 2:
        return Scatter()
    values, errors = (np.array([getattr(each, name) for each in first]) for name in ("value", "std_error"))
    mean = np.average(values, weights=errors**-2.0)
    return Scatter(tuple(((values - mean) / errors).tolist()), len(first) - 1)


def scatter_between_strokes(trials: Sequence[Strokes]) -> Scatter:
    """Compare later strokes, without the decline that the trials have in common."""
    logs, errors = _log_table([strokes[1:] for strokes in trials])
    if not np.isfinite(logs).any():
        return Scatter()
    fit = _fit_additive(logs, errors)
    return Scatter(tuple(fit.residuals.tolist()), fit.dof) if fit.dof > 0 else Scatter()


def separation(one: Sequence[float], other: Sequence[float]) -> float | None:
    """Return the difference of two means in pooled standard deviations; None where a group has fewer than two."""
    if min(len(one), len(other)) < 2:
        return None
    squares = fsum(float(np.var(values, ddof=1)) * (len(values) - 1) for values in (one, other))
    pooled = sqrt(squares / (len(one) + len(other) - 2))
    return float(np.mean(one) - np.mean(other)) / pooled if pooled > 0.0 else None


def _log_table(trials: Sequence[Strokes]) -> tuple[Floats, Floats]:
    """Return ln k of trials (rows) and stroke numbers (columns) with its claimed errors; NaN without a value."""
    logs = np.full((len(trials), max((len(strokes) for strokes in trials), default=0)), np.nan)
    errors = np.ones_like(logs)
    for row, strokes in enumerate(trials):
        for column, estimate in enumerate(strokes):
            if claims_error(estimate) and estimate.value > 0.0:
                logs[row, column] = np.log(estimate.value)
                errors[row, column] = estimate.std_error / estimate.value
    return logs, errors


def _fit_additive(table: Floats, errors: Floats) -> Additive:
    """Fit a mean for each row and one for each column to the known cells, weighted by their errors."""
    rows, columns = np.nonzero(np.isfinite(table))
    known, height = table[rows, columns], len(table)
    design = np.zeros((len(known), height + table.shape[1]))
    design[np.arange(len(known)), rows] = design[np.arange(len(known)), height + columns] = 1.0
    weights = 1.0 / errors[rows, columns]
    solution, _, rank, _ = np.linalg.lstsq(design * weights[:, None], known * weights, rcond=None)
    residuals = (known - design @ solution) * weights
    used = np.unique(columns)
    connected = rank == len(np.unique(rows)) + len(used) - 1
    level = solution[:height] + np.mean(solution[height + used])
    return Additive(level, residuals, len(known) - int(rank), bool(connected))
