"""The fit of a stroke against statsmodels, numpy, padasip and filterpy, and its standard error against many seeds."""

from math import inf, isfinite, nan, sqrt

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import t as student_t

from estimation.strokes import origin_fit
from estimation.strokes.origin_fit import HUBER, LAGS, MIN_BATCHES, OriginFit, fit_through_origin

Array = NDArray[np.float64]
K = 2.0


def fitted(x: Array, y: Array) -> OriginFit:
    fit = fit_through_origin(x.tolist(), y.tolist())
    assert fit is not None
    return fit


def noisy(seed: int, count: int) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    x = np.sort(random.uniform(0.05, 1.0, count))
    return x, K * x + 0.1 * random.standard_normal(count)


def with_outliers(seed: int, count: int) -> tuple[Array, Array]:
    """Return samples in which one batch in seven is far off."""
    random = np.random.default_rng(seed)
    x, y = noisy(seed, count)
    return x, y + np.where(random.random(count) < 1.0 / 7.0, random.normal(0.0, 2.0, count), 0.0)


def calm(seed: int, count: int) -> tuple[Array, Array]:
    """Return samples with uniform noise: no batch is off by three scales, so every weight is one."""
    random = np.random.default_rng(seed)
    x = np.sort(random.uniform(0.05, 1.0, count))
    return x, K * x + 0.1 * random.uniform(-1.0, 1.0, count)


def bend_free(x: Array, y: Array) -> Array:
    """Return `y` shifted so that its line of best fit passes through the origin: our standard error leaves out such a
    bend.
    """
    slope, offset = np.polyfit(x, y, 1)
    through = float(x @ y / (x @ x))
    straightened: Array = through * x + (y - slope * x - offset)
    return straightened


# the slope


@pytest.mark.parametrize("clip", [1.345, HUBER])
def test_the_slope_is_statsmodels_huber_fit(clip: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """statsmodels solves the same problem: HuberT with our clip and a fixed scale, the MAD of the residuals of the same
    first slope, taken about zero and not about their median. With a fixed scale the problem is convex and has one
    solution. The remaining difference is below 1e-5: NORMAL_MAD is rounded by 1.5e-6, which moves the clip as much, and
    our rounds stop at a change of CONVERGED.
    """
    monkeypatch.setattr(origin_fit, "HUBER", clip)
    clipped = 0
    for seed in range(60):
        x, y = with_outliers(seed, 10 + seed)
        start = float(np.median((y / x)[x > x.max() / 3.0]))
        scale = float(sm.robust.scale.mad(y - start * x, center=0.0))
        model = sm.RLM(y, x, M=sm.robust.norms.HuberT(clip))
        oracle = model.fit(start_scale=scale, update_scale=False, conv="coefs", tol=1e-12, maxiter=1000)
        assert fitted(x, y).slope == pytest.approx(float(oracle.params[0]), rel=1e-5)
        clipped += int((oracle.weights < 1.0).any())
    assert clipped > 30  # otherwise this would be least squares


# the standard error


def test_the_students_factors_are_those_of_scipy() -> None:
    """The tolerance is that of the table's three digits."""
    for count in range(MIN_BATCHES, 61):
        freedom, table = count - 2, origin_fit.STUDENT
        factor = table[freedom] if freedom < len(table) else 1.0 + 1.3 / freedom
        assert factor == pytest.approx(float(student_t.ppf(0.975, freedom)) / 1.959964, rel=2e-3)


@given(st.integers(0, 10**6), st.integers(LAGS + 1, 60))
def test_the_standard_error_is_statsmodels_newey_west_or_the_plain_one_whichever_is_more(seed: int, count: int) -> None:
    """The data have no outliers and no bend, which our standard error leaves out. HAC uses our lags and the correction
    n/(n-1); ours also counts the bend's degree of freedom, so both get (n-1)/(n-2) and Student's factor, which has
    three digits.
    """
    x, y = calm(seed, count)
    y = bend_free(x, y)
    plain = sm.OLS(y, x).fit()
    hac = sm.OLS(y, x).fit(cov_type="HAC", cov_kwds={"maxlags": LAGS, "use_correction": True})
    ours = fitted(x, y)
    assume(abs(ours.slope - float(plain.params[0])) < 1e-12)  # otherwise a batch was clipped
    student = float(student_t.ppf(0.975, count - 2)) / 1.959964
    largest = max(float(hac.bse[0]), float(plain.bse[0]))
    assert ours.std_error == pytest.approx(student * sqrt((count - 1) / (count - 2)) * largest, rel=2e-3)


@pytest.mark.parametrize("count", [5, 8, 12, 20, 40])
def test_two_standard_errors_cover_independent_noise_95_times_in_a_hundred_however_short_the_stroke(count: int) -> None:
    """The limits allow three sampling errors of 400 runs to either side, and up to 2 % more since the larger error is
    used.
    """
    fits = [fitted(*noisy(seed, count)) for seed in range(400)]
    assert 0.92 <= np.mean([abs(fit.slope - K) <= 2.0 * fit.std_error for fit in fits]) <= 0.985


def test_a_bend_from_the_law_makes_no_uncertainty() -> None:
    """The mud starts at a force of its own: the slope is that of the mean law, and only scatter counts as
    uncertainty.
    """
    x, y = calm(2, 30)
    straight, bent = fitted(x, y), fitted(x, y + 0.05 - 0.05 * x)
    assert bent.std_error == pytest.approx(straight.std_error, rel=0.2)  # the weights may differ a little


# input that no stroke should give


@pytest.mark.parametrize("count", range(MIN_BATCHES))
def test_too_few_batches_give_no_estimate(count: int) -> None:
    assert fit_through_origin([1.0] * count, [1.0] * count) is None


@pytest.mark.parametrize("x", [0.0, -1.0, 1e-200])
def test_regressors_that_are_not_positive_give_no_estimate(x: float) -> None:
    """The last one vanishes when it is squared."""
    assert fit_through_origin([x] * 10, [1.0] * 10) is None


@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e200])
@pytest.mark.parametrize("index", [0, 5, 9])
def test_a_regressor_that_is_no_number_gives_no_estimate(bad: float, index: int) -> None:
    x = [0.1 * (i + 1) for i in range(10)]
    y = [2.0 * each for each in x]
    x[index] = bad
    assert fit_through_origin(x, y) is None


def test_more_than_half_of_the_batches_exactly_on_the_law_outvote_the_others() -> None:
    """Their scale is zero, so the other batches get no weight and nothing is divided by the scale."""
    x = np.linspace(0.1, 1.0, 10)
    assert fitted(x, np.where(np.arange(10) % 4 > 0, K * x, 50.0)).slope == pytest.approx(K)


anything = st.floats()


@given(st.lists(st.tuples(anything, anything), max_size=30))
def test_nothing_makes_the_fit_raise(pairs: list[tuple[float, float]]) -> None:
    fit = fit_through_origin([x for x, _ in pairs], [y for _, y in pairs])
    assert fit is None or isfinite(fit.slope)
