"""Walks along other paths than the crutching gait give the mud's coefficients."""

import pytest
from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.reports.coefficient_table import compared_frame
from experiments.studies.paths import errors_of, walk


def test_a_walk_along_another_path_gives_the_coefficients_of_a_load_cell() -> None:
    rows = DataFrame(walk("backward", 1400.0, 1, 0.03, 3)["estimates"])
    for name in COEFFICIENTS:
        found = rows[(rows["coefficient"] == name) & (rows["kind"] == "value")]
        assert len(found) >= 4, name
        assert ((found["value"] - found["truth"]).abs() < 2.5 * found["std_error"]).all(), name
        assert (found["value"] / found["truth"]).median() == pytest.approx(1.0, abs=0.25), name


def test_estimates_that_are_not_valid_count() -> None:
    """They name no depth, so no load cell can repeat them. In 300 Pa both flippers feel nothing but friction."""
    rows = walk("walking", 300.0, 1, 0.03, 3)["estimates"]
    found = compared_frame(rows).assign(predicted=[row["predicted"] for row in rows])
    counts = errors_of(found, "coefficient").set_index("coefficient")[["strides", "bounds", "not_valid"]]
    assert counts.sum(axis=1).to_dict() == dict.fromkeys(COEFFICIENTS, 6)
    assert (counts["not_valid"] > 0).all()
