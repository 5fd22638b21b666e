"""Walks along other paths than the crutching gait give the mud's coefficients."""

from math import isfinite

import pytest
from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.studies.grounds import GROUNDS
from experiments.studies.paths import errors_of, walk, with_load_errors
from simulation.mud.clay import Clay


def test_a_walk_along_another_path_gives_the_coefficients_of_a_load_cell() -> None:
    rows = DataFrame(walk("backward", "clay-1.4", 1, 0.03, 3)["estimates"])
    predicted = [error for error in rows["load_error"] if isfinite(error.prediction)]
    assert len(predicted) == 6  # of the second stride of each flipper
    assert all(error.misfit < error.prediction < 0.25 for error in predicted)
    for name in COEFFICIENTS:
        found = rows[(rows["coefficient"] == name) & (rows["kind"] == "value")]
        assert len(found) >= 4, name
        assert ((found["value"] - found["truth"]).abs() < 2.5 * found["std_error"]).all(), name
        assert (found["value"] / found["truth"]).median() == pytest.approx(1.0, abs=0.25), name


def test_estimates_that_are_not_valid_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """They name no depth, so no load cell can repeat them. In 300 Pa both flippers feel nothing but friction."""
    monkeypatch.setitem(GROUNDS, "soft", Clay("soft", 300.0))
    rows = walk("walking", "soft", 1, 0.03, 3)["estimates"]
    counts = errors_of(with_load_errors(rows), "coefficient").set_index("coefficient")[
        ["strides", "bounds", "not_valid"]
    ]
    assert counts.sum(axis=1).to_dict() == dict.fromkeys(COEFFICIENTS, 6)
    assert (counts["not_valid"] > 0).all()
