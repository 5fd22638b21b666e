"""The line and its errors, against statsmodels and against chance."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.stats import t as student_t

from estimation.strokes.origin_fit import student_factor
from experiments.actuator.line import fit_line
from experiments.actuator.plan import PAPER_WEIGHTS_G

TORQUES_NM = [0.0011772 * weight_g for weight_g in PAPER_WEIGHTS_G]
SLOPE, INTERCEPT = 13.9, 0.02


def made_currents(x: list[float], random: Random) -> list[float]:
    """A hook that is off its place errs with the weight, a reading does not."""
    return [SLOPE * nm * (1.0 + random.gauss(0.0, 0.003)) + INTERCEPT + random.gauss(0.0, 0.02) for nm in x]


def test_line_and_errors_are_those_of_statsmodels() -> None:
    x = TORQUES_NM * 5
    y = made_currents(x, Random(1))
    line, oracle = fit_line(x, y), sm.OLS(np.array(y), sm.add_constant(np.array(x))).fit(cov_type="HC3")
    assert (line.intercept_a, line.slope_a_nm) == pytest.approx(tuple(oracle.params), rel=1e-9)
    widened = oracle.bse * student_t.ppf(0.975, 38) / 1.96
    assert (line.intercept_error, line.slope_error) == pytest.approx(tuple(widened), rel=2e-3)
    assert line.readings == 40


@pytest.mark.parametrize(("trials", "low"), [(1, 0.9), (2, 0.92), (5, 0.92)])
def test_two_errors_hold_the_truth_in_nineteen_of_twenty(trials: int, low: float) -> None:
    random, x = Random(2), TORQUES_NM * trials
    lines = [fit_line(x, made_currents(x, random)) for _ in range(600)]
    assert low < np.mean([abs(line.slope_a_nm - SLOPE) < 2.0 * line.slope_error for line in lines]) < 0.98
    assert low < np.mean([abs(line.intercept_a - INTERCEPT) < 2.0 * line.intercept_error for line in lines]) < 0.99


def test_students_factor_is_that_of_scipy() -> None:
    reported = [student_factor(freedom) for freedom in range(1, 60)]
    assert reported == pytest.approx([student_t.ppf(0.975, freedom) / 1.96 for freedom in range(1, 60)], rel=2e-3)
    assert student_factor(0) == np.inf
