"""Coefficients over trials, next to those of a load cell, and the files from which they are read."""

import json
from math import hypot, nan, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student_t

from control.records import COEFFICIENTS
from experiments.reports.coefficient_table import (
    compared_frame,
    compared_rows,
    error_table,
    error_text_table,
    gather_coefficient,
    gathered_text,
    mud_table,
)
from experiments.robot.bench_errors import BenchError
from experiments.trials.coefficient_page import truth_settings
from experiments.trials.truth_file import load_truth, truth_in
from tests.experiments.synthetic_strides import CONFIGURATION, make_estimate, make_stride


def test_trials_make_a_mean_with_its_error_and_scatter() -> None:
    reported = gather_coefficient(make_estimate(value) for value in (1.0e6, 1.2e6, 1.4e6))
    assert reported.value == pytest.approx(1.2e6)
    assert reported.trials_error == pytest.approx(0.2e6 / sqrt(3) * student_t.ppf(0.975, 2) / 1.96, rel=1e-3)
    assert reported.repeatability == pytest.approx(1 / 6)
    assert reported.trials == [1.0e6, 1.2e6, 1.4e6]


def test_the_part_of_an_estimators_error_beyond_the_scatter_is_shared() -> None:
    """Trials with standard errors of 10 % and a scatter of 6 % share an error of 8 %."""
    scattered = gather_coefficient(make_estimate(value, std_error=1e5) for value in (0.94e6, 1e6, 1.06e6))
    assert scattered.shared_error == pytest.approx(8e4)
    assert scattered.std_error is not None and scattered.trials_error is not None
    assert scattered.std_error == pytest.approx(hypot(scattered.trials_error, 8e4))
    large = gather_coefficient(make_estimate(value, std_error=1e4) for value in (0.8e6, 1e6, 1.2e6))
    assert large.shared_error == pytest.approx(0.032e6)  # at least the error of a motor's constant


def test_two_standard_errors_contain_the_truth_19_times_in_20_with_a_shared_error() -> None:
    """Each synthetic trial has an own and a shared error of 4 %, and the corresponding standard error."""
    random, held = np.random.default_rng(1), 0
    for _ in range(1000):
        values = 1e6 * (1.0 + 0.04 * random.standard_normal() + 0.04 * random.standard_normal(3))
        reported = gather_coefficient(make_estimate(float(value), std_error=0.04e6 * sqrt(2.0)) for value in values)
        assert reported.value is not None and reported.std_error is not None
        held += abs(reported.value - 1e6) <= 2.0 * reported.std_error
    assert 940 <= held <= 995


def test_one_trial_has_the_error_of_its_own_estimate() -> None:
    reported = gather_coefficient([make_estimate(1e6, std_error=7e4)])
    assert (reported.value, reported.std_error) == (1e6, 7e4)
    assert reported.repeatability is reported.trials_error is reported.shared_error is None
    assert gathered_text(reported) == "1.000 ± 0.070"


def test_bounds_do_not_mix_with_values() -> None:
    mixed = gather_coefficient([make_estimate(1e6), make_estimate(9e6, at_least=True)])
    assert (mixed.value, mixed.at_least, mixed.bounds) == (1e6, False, 1)
    bounds = gather_coefficient(make_estimate(value, at_least=True) for value in (1e6, 2e6, 9e6))
    assert (bounds.value, bounds.at_least, bounds.bounds, bounds.std_error) == (2e6, True, 3, None)
    assert gathered_text(bounds) == "≥ 2.0"


def test_a_few_strides_in_which_solid_mud_yielded_do_not_count() -> None:
    """Estimates of 1e6 scatter by 5 %, and one that would exceed `limit` is a bound.

    The mean of the others alone would be 7 % too low, and their scatter would not show it.
    """
    limit, values = 0.95e6, 1e6 * (1.0 + 0.05 * np.random.default_rng(1).standard_normal(200))
    strides = [make_estimate(min(value, limit), at_least=value >= limit) for value in values.tolist()]
    alone = gather_coefficient(each for each in strides if not each["at_least"])
    assert alone.value is not None and alone.trials_error is not None
    assert alone.value + 2.0 * alone.trials_error < 1e6
    reported = gather_coefficient(strides)
    assert (reported.value, reported.at_least, reported.std_error) == (limit, True, None)


def test_a_trial_without_a_standard_error_is_not_taken_as_exact() -> None:
    uncertainties = (1e5, nan, 1e5)
    reported = gather_coefficient(
        make_estimate(1e6 + k, std_error=uncertainty) for k, uncertainty in enumerate(uncertainties)
    )
    assert reported.shared_error == pytest.approx(1e5, rel=1e-3)


def test_an_invalid_estimate_does_not_count_but_is_reported() -> None:
    reported = gather_coefficient([make_estimate(1e6), make_estimate(None, reason="too short")])
    assert (reported.value, reported.not_valid) == (1e6, ["too short"])
    nothing = gather_coefficient([make_estimate(None, reason="too short")])
    assert (nothing.value, nothing.std_error, nothing.trials) == (None, None, [])
    assert gathered_text(nothing) == "-"


# a load cell's file


def write_truth(folder: Path, contents: Any) -> Path:
    path = folder / "summary.json"
    path.write_text(contents if isinstance(contents, str) else json.dumps(contents))
    return path


def test_a_mud_is_found_however_its_name_is_written_and_bounds_are_left_out(tmp_path: Path) -> None:
    wet = {"mud": "48.60", "k_p": {"value": 1e6}, "k_s": {"value": None}, "k_e": {"value": 3e6, "at_least": True}}
    muds = [wet, {"mud": "Pond", "k_e": {"value": 2e6, "at_least": False}}]
    truth = load_truth(write_truth(tmp_path, {"muds": muds}))
    assert truth == load_truth(tmp_path) == {"48.6": {"k_p": 1e6}, "pond": {"k_e": 2e6}}
    assert truth_in(truth, "48.6") == truth_in(truth, "w = 48.600 %") == {"k_p": 1e6}
    assert truth_in(truth, "48.61") == {}
    missing = truth_settings({}, CONFIGURATION, truth, ["48.6", "pond", "48.61"])["missing_truth"]
    assert "48.61 %" in missing and "pond" not in missing


@pytest.mark.parametrize(
    "contents",
    [
        "no json",
        "[]",
        {"other": []},
        {"muds": [1]},
        {"muds": [{"k_p": {"value": 1.0}}]},
        {"muds": [{"mud": "a", "k_p": {"value": -1.0}}]},
        {"muds": [{"mud": "a", "k_p": 3.0}]},
    ],
)
def test_another_file_is_refused_with_what_to_give(tmp_path: Path, contents: Any) -> None:
    with pytest.raises(BenchError, match="mudskipper experiment loadcell"):
        load_truth(write_truth(tmp_path, contents))


# tables


def test_errors_are_of_values_and_bounds_are_printed_as_bounds() -> None:
    strides = [
        make_stride(k_p=make_estimate(k_p), k_s=make_estimate(k_s, at_least=True), k_e=None)
        for k_p, k_s in ((1.1e6, 0.8e6), (1.3e6, 0.6e6))
    ]
    known = {"k_p": 1e6, "k_s": 1e6, "k_e": 1e6}
    rows = [row for stride in strides for row in compared_rows(stride, known, mud="49.5", method="default")]
    errors = error_table(compared_frame(rows), "walking")
    assert [row["coefficient"] for row in errors] == ["k_p", "k_s"]  # the method says nothing of k_e
    (row,) = error_text_table(errors).to_numpy().tolist()
    assert row == ["49.5 %", "default", "20 % (+20 %)", "≥ 70 % of it (2)", "-", 2]


def test_a_table_of_muds_has_a_column_of_the_load_cell() -> None:
    reported = gather_coefficient([make_estimate(1.5e6), make_estimate(1.7e6)])
    muds = [{"mud": "47.6", "truth": {"k_p": 1.55e6}} | dict.fromkeys(COEFFICIENTS, reported)]
    row = mud_table(muds).iloc[0].tolist()
    assert row[:4] == ["47.6 %", "1.600 ± 0.65 ± 0.051", "8.8 % of 2", "1.550"]
    assert row[6] == "-"
