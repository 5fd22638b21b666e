"""Which mud lies where."""

import pytest

from simulation.clay import MUDS
from simulation.track import COMPARTMENT_M, Track, paper_track


@pytest.mark.parametrize(
    ("x_m", "name"), [(-0.1, "48.5"), (0.0, "48.5"), (0.6, "48.5"), (0.61, "53.1"), (1.3, "45.3"), (9.0, "45.3")]
)
def test_the_paper_s_track_has_three_muds_and_the_last_goes_on(x_m: float, name: str) -> None:
    assert paper_track().clay_at(x_m) == MUDS[name]


def test_a_track_is_as_long_as_its_segments() -> None:
    assert paper_track().length_m == pytest.approx(3 * COMPARTMENT_M)
    assert Track([(0.5, MUDS["48.5"]), (0.25, MUDS["53.1"])]).length_m == 0.75
