"""The exponent of depth is recovered from strides whose law is known, and only a contradiction is reported."""

import numpy as np
import pytest
from pandas import DataFrame

from experiments.reports.depth_law import fit_depth_law, law_finding

DEPTHS_M = (0.02, 0.025, 0.03, 0.035, 0.04, 0.05)


def strides(exponent: float, scatter: float = 0.05, depths_m: tuple[float, ...] = DEPTHS_M) -> DataFrame:
    """Return strides that claim 5 % and scatter about 0.5 N/cm³ at 3 cm."""
    random, z = np.random.default_rng(4), np.array(depths_m)
    values = 0.5e6 * (z / 0.03) ** exponent * np.exp(scatter * random.standard_normal(len(z)))
    return DataFrame({"value": values, "repeatability": 0.05 * values, "depth_m": z})


@pytest.mark.parametrize("exponent", [-2.0, -0.8, 0.0])
def test_the_exponent_is_that_of_numpys_line(exponent: float) -> None:
    rows = strides(exponent)
    law = fit_depth_law(rows)
    assert law is not None
    assert law.exponent == pytest.approx(np.polyfit(np.log(rows["depth_m"]), np.log(rows["value"]), 1)[0])
    assert abs(law.exponent - exponent) < 2.0 * law.std_error


def test_strides_that_scatter_more_than_they_claim_have_a_larger_error() -> None:
    calm, wild = fit_depth_law(strides(-0.5)), fit_depth_law(strides(-0.5, scatter=0.5))
    assert calm is not None and wild is not None and wild.std_error > 3.0 * calm.std_error


@pytest.mark.parametrize("depths_m", [(0.02, 0.03, 0.05), (0.02, 0.0205, 0.021, 0.0215, 0.022)])
def test_few_strides_or_one_depth_tell_no_exponent(depths_m: tuple[float, ...]) -> None:
    law = fit_depth_law(strides(-3.0, depths_m=depths_m))
    assert law is None and law_finding("k_s", law) == ""


@pytest.mark.parametrize(
    ("exponent", "is_found", "is_constant"), [(-0.6, False, False), (-2.1, True, True), (2.0, True, False)]
)
def test_a_force_that_does_not_depend_on_depth_is_named(exponent: float, is_found: bool, is_constant: bool) -> None:
    finding = law_finding("k_s", fit_depth_law(strides(exponent)))
    assert (bool(finding), "does not depend on depth" in finding) == (is_found, is_constant)
