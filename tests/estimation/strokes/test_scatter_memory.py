"""The pooled scatter of strokes: it recovers a known noise from short strokes and never hides a rough one."""

from math import sqrt

import numpy as np
import pytest

from estimation.strokes.origin_fit import OriginFit, fit_through_origin
from estimation.strokes.scatter_memory import ScatterMemory

SLOPE, NOISE = 2.0, 0.1
X = [0.4, 0.8, 1.2, 1.6, 2.0]


def short_stroke(rng: np.random.Generator, noise: float = NOISE) -> OriginFit:
    fit = fit_through_origin(X, [SLOPE * x + noise * float(rng.standard_normal()) for x in X])
    assert fit is not None
    return fit


def test_the_first_stroke_keeps_its_own_standard_error() -> None:
    fit = short_stroke(np.random.default_rng(1))
    assert ScatterMemory().pooled(fit).std_error == pytest.approx(fit.std_error)


def test_short_strokes_cover_their_slope_with_a_smaller_error_once_they_are_pooled() -> None:
    rng = np.random.default_rng(2)
    alone, together, covered = [], [], []
    for _ in range(60):
        memory = ScatterMemory()
        for index in range(10):
            fit = short_stroke(rng)
            pooled = memory.pooled(fit)
            if index >= 4:
                alone.append(fit.std_error)
                together.append(pooled.std_error)
                covered.append(abs(pooled.slope - SLOPE) < 2.0 * pooled.std_error)
    assert np.mean(together) < 0.9 * np.mean(alone)
    assert np.std(together) < 0.5 * np.std(alone)
    assert 0.93 <= np.mean(covered) <= 1.0


def test_a_rough_stroke_keeps_its_own_scatter() -> None:
    rng, memory = np.random.default_rng(3), ScatterMemory()
    for _ in range(8):
        memory.pooled(short_stroke(rng))
    rough = short_stroke(rng, 10.0 * NOISE)
    assert memory.pooled(rough).std_error >= sqrt(rough.variance / rough.square)


def test_a_reset_forgets_the_strokes_before() -> None:
    rng, memory = np.random.default_rng(4), ScatterMemory()
    memory.pooled(short_stroke(rng, 10.0 * NOISE))
    memory.reset()
    fit = short_stroke(rng)
    assert memory.pooled(fit).std_error == pytest.approx(fit.std_error)
