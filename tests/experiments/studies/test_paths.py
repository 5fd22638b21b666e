"""Walks along other paths than the crutching gait give the mud's coefficients."""

import pytest
from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.studies.paths import walk


def test_a_walk_along_another_path_gives_the_coefficients_of_a_load_cell() -> None:
    rows = DataFrame(walk("backward", 1400.0, 1, 0.03, 3)["estimates"])
    for name in COEFFICIENTS:
        found = rows[(rows["coefficient"] == name) & (rows["kind"] == "value")]
        assert len(found) >= 4, name
        assert ((found["value"] - found["truth"]).abs() < 2.5 * found["std_error"]).all(), name
        assert (found["value"] / found["truth"]).median() == pytest.approx(1.0, abs=0.25), name
