"""How well trials in one mud repeat, and whether their scatter agrees with the repeatability that they claim.

The rows are one coefficient's estimates with their trial and stroke: the first stroke in fresh mud, then the later ones
in its hole. A hole weakens with every stroke, so later strokes are compared after their trial's mean and the mean of
their number are removed from ln k: that decline is mud, not error.

chi is sqrt(chi² / degrees of freedom) of the scatter in claimed errors: 1 where the claimed errors are right, 2 where
they are half of the true ones.
"""

from collections.abc import Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame, Series, get_dummies

from experiments.lablogs.estimates import has_error
from experiments.reports.depth_law import fit_depth_law, law_finding

Floats = NDArray[np.float64]


class Scatter(NamedTuple):
    """Deviations in units of their claimed errors."""

    deviations: Floats = np.empty(0)
    dof: int = 0

    @property
    def chi(self) -> float | None:
        return sqrt(float(np.sum(self.deviations**2)) / self.dof) if self.dof > 0 else None


class Additive(NamedTuple):
    """Logarithms of values, fitted by one mean for each trial and one for each stroke number."""

    levels: Floats  # of the trials
    residuals: Floats
    dof: int
    connected: bool  # the trials can be compared with each other through strokes that they share


def repeatability(strokes: DataFrame) -> dict[str, Any]:
    """Return the variation and the scatter of one coefficient; None where the trials are too few."""
    first, later = first_values(strokes)["value"], later_levels(strokes)
    trials, later_strokes = scatter_between_trials(strokes), scatter_between_strokes(strokes)
    found = {
        "first_cv": coefficient_of_variation(first),
        "later_cv": coefficient_of_variation(later),
        "chi": pooled([trials, later_strokes]).chi,
        "chi_between_trials": trials.chi,
        "chi_between_strokes": later_strokes.chi,
    }
    return _rounded(found) | {
        "n": len(first),  # trials with a first value
        "n_later": len(later),
        "first_mean": round(float(first.mean())) if len(first) else None,  # N/m³
    }


def walk_scatter(coefficient: str, strides: DataFrame) -> dict[str, Any]:
    """Return how one coefficient scatters over the strides of walks in one mud, and how it changes with depth.

    claim: median repeatability over the value. exponent: of the depth. finding: what contradicts the depth law of mud.
    A flipper that re-entered its hole met disturbed mud: chi compares these strides among themselves, and they do not
    show how undisturbed mud changes with depth.
    """
    known = _with_logarithm(strides)
    law = fit_depth_law(known[~known["re_entered"]])
    found = {
        "log_sd": float(known["logarithm"].std()) if len(known) > 1 else None,
        "claim": float(known["error"].median()) if len(known) else None,
        "chi": pooled([scatter_about_mean(each) for _, each in known.groupby("re_entered")]).chi,
        "exponent": law.exponent if law else None,
        "exponent_std_error": law.std_error if law else None,
    }
    return _rounded(found) | {"re_entered": int(known["re_entered"].sum()), "finding": law_finding(coefficient, law)}


def _rounded(found: dict[str, float | None]) -> dict[str, Any]:
    return {name: None if value is None else round(value, 4) for name, value in found.items()}


def pooled(parts: Sequence[Scatter]) -> Scatter:
    """Return the scatter of all parts, each about means of its own."""
    deviations = [each.deviations for each in (Scatter(), *parts)]  # of no part too
    return Scatter(np.concatenate(deviations), sum(each.dof for each in parts))


def scatter_about_mean(known: DataFrame) -> Scatter:
    """Compare logarithms with their weighted mean."""
    if len(known) < 2:
        return Scatter()
    logarithms, errors = known["logarithm"].to_numpy(), known["error"].to_numpy()
    return Scatter((logarithms - np.average(logarithms, weights=errors**-2.0)) / errors, len(known) - 1)


def first_values(strokes: DataFrame) -> DataFrame:
    """Return the first stroke of each trial that has a value there."""
    return strokes[(strokes["stroke"] == 0) & (strokes["kind"] == "value")]


def coefficient_of_variation(values: "Series[float]") -> float | None:
    """Return the sample standard deviation over the mean; None for fewer than two values."""
    mean = float(values.mean()) if len(values) > 1 else 0.0
    return float(values.std()) / mean if mean > 0.0 else None


def later_levels(strokes: DataFrame) -> "Series[float]":
    """Return each trial's geometric mean over its later strokes, the same number of them in every trial.

    Where values are missing, the mean is that of a complete trial with the same decline. Empty where trials share no
    stroke number.
    """
    later = strokes[strokes["stroke"] > 0]
    common = later.groupby("trial")["stroke"].max().min()
    known = _with_logarithm(later[later["stroke"] <= common])
    if known["trial"].nunique() < 2:
        return Series(dtype=float)
    fit = _fit_additive(known.assign(error=1.0))
    return Series(np.exp(fit.levels) if fit.connected else [], dtype=float)


def scatter_between_trials(strokes: DataFrame) -> Scatter:
    """Compare first strokes with their weighted mean."""
    first = first_values(strokes)
    first = first[has_error(first)]
    if len(first) < 2:
        return Scatter()
    values, errors = first["value"].to_numpy(), first["repeatability"].to_numpy()
    return Scatter((values - np.average(values, weights=errors**-2.0)) / errors, len(first) - 1)


def scatter_between_strokes(strokes: DataFrame) -> Scatter:
    """Compare later strokes, without the decline that the trials have in common."""
    known = _with_logarithm(strokes[strokes["stroke"] > 0])
    fit = _fit_additive(known) if len(known) else None
    return Scatter(fit.residuals, fit.dof) if fit and fit.dof > 0 else Scatter()


def separation(one: "Series[float]", other: "Series[float]") -> float | None:
    """Return the difference of two means in pooled standard deviations; None where a group has fewer than two."""
    if min(len(one), len(other)) < 2:
        return None
    squares = sum(float(values.var()) * (len(values) - 1) for values in (one, other))
    pooled = sqrt(squares / (len(one) + len(other) - 2))
    return float(one.mean() - other.mean()) / pooled if pooled > 0.0 else None


def _with_logarithm(strokes: DataFrame) -> DataFrame:
    """Return the values that claim an error, with ln k and its error."""
    known = strokes[has_error(strokes) & (strokes["value"] > 0.0)]
    return known.assign(logarithm=np.log(known["value"]), error=known["repeatability"] / known["value"])


def _fit_additive(known: DataFrame) -> Additive:
    """Fit a mean for each trial and one for each stroke number, weighted by the errors."""
    trials, strokes = get_dummies(known["trial"]), get_dummies(known["stroke"])
    design = np.hstack([trials, strokes]).astype(float)
    logarithms, weights = known["logarithm"].to_numpy(), 1.0 / known["error"].to_numpy()
    solution, _, rank, _ = np.linalg.lstsq(design * weights[:, None], logarithms * weights, rcond=None)
    count = trials.shape[1]
    return Additive(
        levels=solution[:count] + np.mean(solution[count:]),
        residuals=(logarithms - design @ solution) * weights,
        dof=len(known) - int(rank),
        connected=bool(rank == design.shape[1] - 1),
    )
