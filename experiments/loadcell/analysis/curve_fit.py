"""Nonlinear least squares by variable projection (Golub and Pereyra 1973).

A few parameters enter nonlinearly, and the rest are factors of columns: for every choice of the parameters the factors
come from a linear fit, so that the search runs over the parameters alone. The search is Levenberg and Marquardt's, with
finite differences. A prior on a parameter counts as one more residual.
"""

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
    square: float  # sum of squared residuals of the samples, without those of the prior


class Prior(NamedTuple):
    means: Array
    std_errors: Array  # infinite where nothing is known


def fit_curve(
    shapes: Callable[[Array], Array], y: Array, starts: Sequence[Array], prior: Prior, noise: float
) -> CurveFit:
    """Fit from several starts, each for a few rounds, and go on from the best.

    `shapes` returns one column for each factor; `noise` is the standard deviation of a sample, which weighs the prior.
    """

    def residuals(parameters: Array) -> tuple[Array, Array]:
        columns = shapes(parameters)
        factors = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], dtype=np.float64)
        away = noise * (parameters - prior.means) / prior.std_errors
        return np.concatenate([columns @ factors - y, away]), factors

    found = [_search(residuals, start, FIRST_ROUNDS) for start in starts] if len(starts) > 1 else list(starts)
    point = min(found, key=lambda point: _square(residuals, point)) if len(found) > 1 else found[0]
    point = _search(residuals, point, ROUNDS)
    remaining, factors = residuals(point)
    samples = remaining[: len(y)]
    slopes = _slopes(residuals, point)
    variance = float(remaining @ remaining) / max(len(remaining) - 2 * len(point), 1)
    std_errors = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(slopes.T @ slopes)), 0.0))
    return CurveFit(point, std_errors, factors, float(samples @ samples))


def cheaper_fit(plain: CurveFit, richer: CurveFit, factor: int, sign: float, price: float, samples: int) -> CurveFit:
    """Return the richer fit where its factor has the right sign and pays for itself.

    The improvement is in logarithms of the number of samples: 1 is Schwarz's price of a factor.
    """
    saved = float(samples * np.log(plain.square / richer.square) / np.log(samples))
    return richer if sign * richer.factors[factor] > 0.0 and saved > price else plain


Residuals = Callable[[Array], tuple[Array, Array]]


def _square(residuals: Residuals, point: Array) -> float:
    remaining, _ = residuals(point)
    return float(remaining @ remaining)


def _search(residuals: Residuals, point: Array, rounds: int) -> Array:
    """Run Levenberg and Marquardt's search."""
    (remaining, _), damping = residuals(point), 1e-2
    for _ in range(rounds):
        slopes = _slopes(residuals, point)
        normal, gradient = slopes.T @ slopes, slopes.T @ remaining
        square = float(remaining @ remaining)
        for _ in range(MOST_DAMPINGS):
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient)
            tried, _ = residuals(point + step)
            if tried @ tried < square:
                break
            damping *= 4.0
        else:
            return point
        point, remaining, damping = point + step, tried, 0.3 * damping
        if square - remaining @ remaining < CONVERGED * square:
            return point
    return point


def _slopes(residuals: Residuals, point: Array) -> Array:
    steps = DIFFERENCES * np.eye(len(point))
    return np.stack(
        [(residuals(point + step)[0] - residuals(point - step)[0]) / (2.0 * DIFFERENCES) for step in steps], 1
    )
