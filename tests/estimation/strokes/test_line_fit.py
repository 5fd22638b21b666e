"""The running fit of y = k x against numpy's batch solution, and its standard error against many seeds."""

from math import isfinite, nan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from control.records import Estimate
from estimation.strokes.line_fit import LARGEST_UNCERTAINTY, MIN_SAMPLES, LineFit

Array = NDArray[np.float64]


def fitted(x: Array, y: Array) -> Estimate:
    fit = LineFit()
    for each_x, each_y in zip(x.tolist(), y.tolist(), strict=True):
        fit.update(each_x, each_y)
    return fit.estimate()


def noisy_line(seed: int, count: int, k: float, noise: float) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    x = random.uniform(0.1, 3.0, count)
    return x, k * x + noise * random.standard_normal(count)


@given(st.integers(0, 10**6), st.integers(MIN_SAMPLES, 300), st.floats(0.1, 3.0), st.floats(0.3, 3.0))
def test_the_fit_equals_numpys_least_squares(seed: int, count: int, k: float, noise: float) -> None:
    x, y = noisy_line(seed, count, k, noise)
    solution, residual, _, _ = np.linalg.lstsq(x[:, None], y)
    estimate = fitted(x, y)
    assert estimate.value == pytest.approx(float(solution[0]), rel=1e-9, abs=1e-12)
    assert estimate.std_error == pytest.approx(sqrt(float(residual[0]) / (count - 1) / float(x @ x)), rel=1e-9)
    assert estimate.samples == count


@pytest.mark.parametrize("count", range(MIN_SAMPLES + 2))
def test_too_few_samples_give_no_estimate(count: int) -> None:
    x = np.linspace(0.5, 1.0, count)
    estimate = fitted(x, x)
    assert estimate.valid == (count >= MIN_SAMPLES)
    assert estimate.samples == count
    assert ("fewer than 5 samples" in estimate.reason) == (count < MIN_SAMPLES)


def test_samples_at_the_surface_give_no_estimate() -> None:
    estimate = fitted(np.zeros(50), np.ones(50))
    assert not estimate.valid
    assert estimate.reason
    assert not isfinite(estimate.value)


@pytest.mark.parametrize("k", [-1.0, 0.0])
def test_a_force_along_the_motion_is_not_valid(k: float) -> None:
    estimate = fitted(np.linspace(0.1, 1.0, 20), k * np.linspace(0.1, 1.0, 20))
    assert not estimate.valid
    assert estimate.value == pytest.approx(k)
    assert estimate.reason == "the force does not oppose the motion"


def test_an_error_above_half_of_the_value_is_too_large() -> None:
    verdicts = set()
    for noise in np.linspace(0.1, 8.0, 200):
        estimate = fitted(*noisy_line(7, 20, 1.0, float(noise)))
        if estimate.value > 0.0:
            assert estimate.valid == (estimate.std_error <= LARGEST_UNCERTAINTY * estimate.value)
            assert (estimate.reason == "") == estimate.valid
            verdicts.add(estimate.valid)
    assert verdicts == {True, False}


def test_a_sample_that_is_not_a_number_never_gives_a_valid_estimate() -> None:
    for bad in ((nan, 1.0), (1.0, nan)):
        fit = LineFit()
        for x in range(1, 20):
            fit.update(float(x), float(x))
        fit.update(*bad)
        assert not fit.estimate().valid


def test_a_reset_forgets_everything() -> None:
    x, y = noisy_line(3, 30, 2.0, 0.1)
    fit = LineFit()
    fit.update(100.0, -5.0)
    fit.reset()
    for each_x, each_y in zip(x.tolist(), y.tolist(), strict=True):
        fit.update(each_x, each_y)
    assert fit.estimate() == fitted(x, y)
