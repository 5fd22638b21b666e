"""Differences of runs: known ones are found, with the right uncertainty, and equal runs do not differ."""

from math import hypot

import numpy as np
import pytest

from experiments.run_report.comparison import SPEED, ComparedRun, Difference, differences
from experiments.run_report.run import ReportedStride
from experiments.run_report.tables import difference_rows
from tests.experiments.run_report.synthetic_runs import compared, estimates, renamed, stride


def run_with(values: list[float], name: str = "run", mud: str = "48.5", speed_m_s: float = 0.05) -> ComparedRun:
    """Return a run with a stride for each value; the right flipper reads 1 % more, and the speeds scatter by 4 %."""
    return compared(
        [
            stride(mud, estimates(value), estimates(1.01 * value), speed_m_s * (0.96 if i % 2 else 1.04), 1.0)
            for i, value in enumerate(values)
        ],
        name,
    )


def difference(first: ComparedRun, other: ComparedRun, quantity: str = "k_p") -> Difference:
    (found,) = [each for each in differences([first, other]) if each.quantity == quantity]
    return found


def test_a_known_difference_is_found_with_the_errors_of_both() -> None:
    first, other = run_with([1.0e6, 1.02e6, 0.98e6, 1.0e6], "a"), run_with([1.3e6, 1.31e6, 1.28e6, 1.3e6], "b")
    found = difference(first, other)
    assert found.difference == pytest.approx(0.2975e6 * 1.005) and found.is_shown
    errors = [each.headline.muds[0].both["k_p"].trials_error or 0.0 for each in (first, other)]
    assert found.std_error == pytest.approx(hypot(*errors))
    speed = difference(first, run_with([1e6] * 4, "c", speed_m_s=0.06), SPEED)
    assert speed.difference == pytest.approx(0.01) and speed.is_shown


def test_runs_of_two_robots_also_have_the_errors_that_each_shares_among_its_strides() -> None:
    first, other = run_with([1.0e6, 1.02e6] * 4), run_with([1.05e6, 1.07e6] * 4)
    same, another = difference(first, other), difference(first, renamed(other, "R2"))
    whole = [each.headline.muds[0].both["k_p"].std_error or 0.0 for each in (first, other)]
    assert another.std_error == pytest.approx(hypot(*whole))
    assert same.std_error is not None and same.std_error < 0.5 * hypot(*whole)
    assert same.is_shown and not another.is_shown


def test_equal_runs_differ_once_in_twenty() -> None:
    """Each run has eight values with 8 % scatter; two standard errors contain 95 % of the differences."""
    random, count = np.random.default_rng(2), 400
    shown = 0
    for _ in range(count):
        first, other = (compared([two_values(*random.normal(1e6, 0.08e6, 2)) for _ in range(4)]) for _ in range(2))
        shown += bool(difference(first, other).is_shown)
    assert 0.01 < shown / count < 0.07


def two_values(left: float, right: float) -> ReportedStride:
    return stride("48.5", estimates(left), estimates(right))


def test_muds_are_compared_by_name_however_it_is_written_and_bounds_are_not() -> None:
    first = run_with([1.0e6, 1.1e6], mud="w = 48.5 %")
    assert {each.quantity for each in differences([first, run_with([1.0e6, 1.1e6], mud="48.50")])} == {
        SPEED,
        *("k_p", "k_s", "k_e"),
    }
    assert differences([first, run_with([1.0e6, 1.1e6], mud="pond")]) == []
    bound = estimates(1e6, at_least=True)
    assert [e.quantity for e in differences([first, compared([stride("48.5", bound, bound, 0.1, 1.0)])])] == [SPEED]


def test_a_single_stride_has_a_difference_without_an_uncertainty_of_its_speed() -> None:
    good = estimates(1e6)
    single = compared([stride("48.5", good, good, 0.05, 1.0)])
    found = difference(run_with([1.0e6, 1.1e6]), single, SPEED)
    assert found.std_error is None and found.is_shown is None
    assert difference_rows([found])[1][-1] == "uncertainty not known"
