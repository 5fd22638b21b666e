"""Fits of y = k x side by side: ours, and libraries that do the same sample by sample or at once.

A library is imported when its fit is made, so a benchmark runs without it and says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module

from estimation.strokes.line_fit import LineFit
from estimation.strokes.origin_fit import fit_through_origin

Fit = Callable[[Sequence[float], Sequence[float]], float]  # the slope
VAGUE = 1e9  # variance of a slope of which nothing is known, where x and y are about 1


def our_line_fit() -> Fit:
    def fit(x: Sequence[float], y: Sequence[float]) -> float:
        line = LineFit()
        for each_x, each_y in zip(x, y, strict=True):
            line.update(each_x, each_y)
        return line.estimate().value

    return fit


def our_origin_fit() -> Fit:
    def fit(x: Sequence[float], y: Sequence[float]) -> float:
        found = fit_through_origin(x, y)
        if found is None:
            raise ValueError("too few samples, or none with a regressor")
        return found.slope

    return fit


def numpy_lstsq() -> Fit:
    numpy = import_module("numpy")

    def fit(x: Sequence[float], y: Sequence[float]) -> float:
        return float(numpy.linalg.lstsq(numpy.array(x)[:, None], numpy.array(y), rcond=None)[0][0])

    return fit


def padasip_rls() -> Fit:
    numpy, filters = import_module("numpy"), import_module("padasip.filters")

    def fit(x: Sequence[float], y: Sequence[float]) -> float:
        recursive = filters.FilterRLS(1, mu=1.0, eps=1.0 / VAGUE, w="zeros")  # mu: forgets nothing
        for each_x, each_y in zip(x, y, strict=True):
            recursive.adapt(each_y, numpy.array([each_x]))
        return float(recursive.w[0])

    return fit


def filterpy_kalman() -> Fit:
    numpy, kalman = import_module("numpy"), import_module("filterpy.kalman")

    def fit(x: Sequence[float], y: Sequence[float]) -> float:
        constant = kalman.KalmanFilter(dim_x=1, dim_z=1)
        constant.P *= VAGUE
        for each_x, each_y in zip(x, y, strict=True):
            constant.update(each_y, H=numpy.array([[each_x]]))
        return float(constant.x[0, 0])

    return fit


def statsmodels_recursive() -> Fit:
    models = import_module("statsmodels.api")

    def fit(x: Sequence[float], y: Sequence[float]) -> float:
        return float(models.RecursiveLS(list(y), list(x)).fit().params[0])

    return fit


FITS: dict[str, Callable[[], Fit]] = {
    "our LineFit": our_line_fit,
    "our fit_through_origin": our_origin_fit,
    "numpy.linalg.lstsq": numpy_lstsq,
    "padasip FilterRLS": padasip_rls,
    "filterpy KalmanFilter": filterpy_kalman,
    "statsmodels RecursiveLS": statsmodels_recursive,
}
