"""Variable projection recovers the known parameters of a curve."""

import numpy as np
import pytest

from experiments.loadcell.curve_fit import Array, Prior, fit_curve

T = np.linspace(0.0, 4.0, 80)
NOTHING_KNOWN = Prior(np.zeros(1), np.array([np.inf]))


def fading(parameters: Array) -> Array:
    return np.stack([np.ones_like(T), np.exp(-np.exp(parameters[0]) * T)], 1)


def test_the_standard_error_is_the_scatter_over_many_fits() -> None:
    random = np.random.default_rng(1)
    fits = [
        fit_curve(
            fading, 2.0 + 3.0 * np.exp(-1.5 * T) + random.normal(0.0, 0.05, len(T)), [np.zeros(1)], NOTHING_KNOWN, 0.05
        )
        for _ in range(60)
    ]
    scatter = float(np.std([fit.parameters[0] for fit in fits]))
    assert np.mean([fit.std_errors[0] for fit in fits]) == pytest.approx(scatter, rel=0.3)
