"""Least squares where a few numbers enter as they please and the rest are factors: variable projection.

Golub and Pereyra (1973): for every choice of the few, the factors come from a linear fit, so that the search goes
through the few alone. The search is Levenberg and Marquardt's, with differences for derivatives. A prior, each of the
few near a value give or take its doubt, counts as so many more residuals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROUNDS, FIRST_ROUNDS = 40, 5
CONVERGED = 1e-6  # of the sum of squares
DIFFERENCES = 1e-4  # of the parameters, which are times in s or logarithms
MOST_DAMPINGS = 7


class CurveFit(NamedTuple):
    parameters: Array
    std_errors: Array
    factors: Array
    square: float  # sum of squared residuals of the samples, without the prior's


class Prior(NamedTuple):
    means: Array
    std_errors: Array  # infinite where nothing is known


def fit_curve(
    shapes: Callable[[Array], Array], y: Array, starts: Sequence[Array], prior: Prior, noise: float
) -> CurveFit:
    """`shapes` gives a column for each factor; `noise` is what the doubt of the prior is held against. From every start
    a few rounds; the best one goes on.
    """

    def residuals(parameters: Array) -> tuple[Array, Array]:
        columns = shapes(parameters)
        factors = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], dtype=np.float64)
        away = noise * (parameters - prior.means) / prior.std_errors
        return np.concatenate([columns @ factors - y, away]), factors

    begun = [_search(residuals, start, FIRST_ROUNDS) for start in starts] if len(starts) > 1 else list(starts)
    place = min(begun, key=lambda place: _square(residuals, place)) if len(begun) > 1 else begun[0]
    place = _search(residuals, place, ROUNDS)
    reported, factors = residuals(place)
    samples = reported[: len(y)]
    return CurveFit(place, _std_errors(residuals, place, reported), factors, float(samples @ samples))


def saved_by(richer: CurveFit, plain: CurveFit, samples: int) -> float:
    """In logarithms of the number of samples: 1 is the price of a factor by Schwarz's criterion."""
    return float(samples * np.log(plain.square / richer.square) / np.log(samples))


Residuals = Callable[[Array], tuple[Array, Array]]


def _square(residuals: Residuals, place: Array) -> float:
    reported, _ = residuals(place)
    return float(reported @ reported)


def _search(residuals: Residuals, place: Array, rounds: int) -> Array:
    """Levenberg and Marquardt."""
    (reported, _), damping = residuals(place), 1e-2
    for _ in range(rounds):
        slopes = _slopes(residuals, place)
        normal, gradient = slopes.T @ slopes, slopes.T @ reported
        square = float(reported @ reported)
        for _ in range(MOST_DAMPINGS):
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient)
            tried, _ = residuals(place + step)
            if tried @ tried < square:
                break
            damping *= 4.0
        else:
            return place
        place, reported, damping = place + step, tried, 0.3 * damping
        if square - reported @ reported < CONVERGED * square:
            return place
    return place


def _slopes(residuals: Residuals, place: Array) -> Array:
    steps = DIFFERENCES * np.eye(len(place))
    return np.stack(
        [(residuals(place + step)[0] - residuals(place - step)[0]) / (2.0 * DIFFERENCES) for step in steps], 1
    )


def _std_errors(residuals: Residuals, place: Array, reported: Array) -> Array:
    slopes = _slopes(residuals, place)
    variance = float(reported @ reported) / max(len(reported) - 2 * len(place), 1)
    return np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(slopes.T @ slopes)), 0.0))
