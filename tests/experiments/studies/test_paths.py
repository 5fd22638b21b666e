"""Walks along other paths than the crutching gait give the mud's coefficients."""

import pytest
from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.studies.paths import walk


def test_a_walk_along_another_path_gives_the_coefficients_of_a_load_cell() -> None:
    rows = DataFrame(walk("backward", 1400.0, 1, 0.03, 3)["estimates"])
    for name in COEFFICIENTS:
        found = rows[rows["coefficient"] == name]
        assert found["ratio"].count() >= 4, name
        assert (found["normal"].dropna().abs() < 2.5).all(), name
        assert found["ratio"].median() == pytest.approx(1.0, abs=0.25), name
