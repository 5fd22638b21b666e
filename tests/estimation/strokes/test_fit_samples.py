"""R² and residuals of a fit: by hand, against statsmodels, and for the samples that the estimator itself fitted."""

from math import isnan
from pathlib import Path

import numpy as np
import pytest
import statsmodels.api as sm

from control.records import COEFFICIENTS
from estimation.strokes.fit_samples import FitSamples
from logs.replay import replay_files

EXACT = 1e-12  # rounding


def test_a_batch_counts_by_its_travel_as_in_weighted_least_squares() -> None:
    random = np.random.default_rng(3)
    moments, weights = random.uniform(0.5, 2.0, 30), random.uniform(0.1, 1.0, 30)
    torques = 1.3 * moments + random.normal(0.0, 0.2, 30)
    fitted = sm.WLS(torques, moments, weights=weights).fit()
    samples = FitSamples(moments.tolist(), torques.tolist(), weights.tolist(), [], [], float(fitted.params[0]))
    assert samples.r_squared == pytest.approx(fitted.rsquared)
    np.testing.assert_allclose(samples.residuals_nm, fitted.resid)


def test_a_constant_torque_is_no_evidence_of_the_law() -> None:
    flat = FitSamples([1.0, 2.0, 3.0], [1.0, 1.0, 1.0], [1.0] * 3, [], [], 3.0 / 7.0)
    assert flat.r_squared > 0.8 and isnan(flat.r_squared_about_mean)
    almost = flat._replace(torques_nm=[1.0, 1.0, 1.01])
    assert almost.r_squared_about_mean < 0.0


def test_a_replay_returns_the_samples_that_its_estimates_were_fitted_to(two_walks: Path) -> None:
    """The slope is the reported value to the last digit; a bound has no samples."""
    replayed = replay_files([two_walks])
    fitted = 0
    for stride, fits in zip(replayed.strides, replayed.fits, strict=True):
        for name in COEFFICIENTS:
            estimate, samples = getattr(stride, name), getattr(fits, name)()
            assert (samples is None) == (estimate.at_least or not estimate.samples)
            if samples is not None:
                fitted += 1
                assert samples.slope == estimate.value
                assert len({len(column) for column in samples[:-1]}) == 1
                assert 0.0 < max(samples.depths_m) <= estimate.depth_m + EXACT
                side = {"k_p": 1.0, "k_s": samples.sweeps_rad[0], "k_e": -1.0}[name]
                assert side * samples.sweeps_rad[0] > 0.0  # insertions are at the front, extractions at the rear
                weighted = np.array(samples.weights_m) * samples.moments_m4
                plain = np.dot(weighted, samples.torques_nm) / np.dot(weighted, samples.moments_m4)
                assert samples.slope == pytest.approx(plain, rel=0.3)  # outliers count less in the slope
    assert fitted >= len(replayed.strides)
