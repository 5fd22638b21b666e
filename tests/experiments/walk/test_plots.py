"""The bars of figure 7 say of the strides what their caption says."""

from collections.abc import Callable
from statistics import fmean, median, stdev

import pytest

from experiments.reports.coefficient_table import gather_coefficient
from experiments.walk.plots import bar_of


@pytest.mark.parametrize(("at_least", "average"), [(False, fmean), (True, median)])
def test_a_bar_has_the_mean_or_of_bounds_the_median_and_the_deviation_over_strides(
    at_least: bool, average: Callable[[list[float]], float]
) -> None:
    trials = [1.0, 1.5, 9.0]  # N/cm³
    reports = [{"value": 1e6 * each, "valid": True, "at_least": at_least, "reason": ""} for each in trials]
    _, value, deviation, _, _, hatch = bar_of("default", "C0", {"depth_cm": 3.0}, gather_coefficient(reports))
    assert (value, deviation) == pytest.approx((average(trials), stdev(trials)))
    assert bool(hatch) is at_least
