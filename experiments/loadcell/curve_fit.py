"""Nonlinear least squares by variable projection (Golub and Pereyra 1973).

A few parameters enter nonlinearly, and the rest are factors of columns: for every choice of the parameters the factors
come from a linear fit, so that the search runs over the parameters alone. A prior on a parameter counts as one more
residual. Differences for the slopes are finite: the columns have kinks, where samples enter the mud.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

Array = NDArray[np.float64]

FIRST_EVALUATIONS = 6  # from each start, before the best one is continued
CONVERGED = 1e-6  # of the sum of squares
DIFFERENCES = 1e-4  # of the parameters, which are times in s or logarithms


class CurveFit(NamedTuple):
    parameters: Array
    std_errors: Array
    factors: Array
    square: float  # sum of squared residuals of the samples, without those of the prior


Prior = tuple[Array, Array]  # means and standard errors, infinite where nothing is known


def fit_curve(
    shapes: Callable[[Array], Array], y: Array, starts: Sequence[Array], prior: Prior, noise: float
) -> CurveFit:
    """Return the best fit from several starts.

    `shapes` returns one column for each factor; `noise` is the standard deviation of a sample, which weighs the prior.
    """

    means, prior_errors = prior

    def project(parameters: Array) -> tuple[Array, Array]:
        columns = shapes(parameters)
        factors = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], dtype=np.float64)
        return columns @ factors - y, factors

    def residuals(parameters: Array) -> Array:
        return np.concatenate([project(parameters)[0], noise * (parameters - means) / prior_errors])

    def slopes(parameters: Array) -> Array:
        steps = DIFFERENCES * np.eye(len(parameters))
        differences = [residuals(parameters + step) - residuals(parameters - step) for step in steps]
        return np.stack(differences, 1) / (2.0 * DIFFERENCES)

    def search(start: Array, evaluations: int | None = None) -> OptimizeResult:
        return least_squares(residuals, start, slopes, method="lm", ftol=CONVERGED, max_nfev=evaluations)

    begun = (search(start, FIRST_EVALUATIONS) for start in starts)
    found = search(min(begun, key=lambda each: float(each.cost)).x)
    samples, factors = project(found.x)
    variance = 2.0 * found.cost / max(len(found.fun) - 2 * len(found.x), 1)
    std_errors = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(found.jac.T @ found.jac)), 0.0))
    return CurveFit(found.x, std_errors, factors, float(samples @ samples))


def cheaper_fit(plain: CurveFit, richer: CurveFit, factor: int, sign: float, price: float, samples: int) -> CurveFit:
    """Return the richer fit where its factor has the right sign and pays for itself.

    The improvement is in logarithms of the number of samples: 1 is Schwarz's price of a factor.
    """
    saved = float(samples * np.log(plain.square / richer.square) / np.log(samples))
    return richer if sign * richer.factors[factor] > 0.0 and saved > price else plain
