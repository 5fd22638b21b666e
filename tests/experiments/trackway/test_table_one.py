"""Table I of the paper: the simulated trackway has the speeds of both fixed depths in all three muds."""

import pytest

from experiments.trackway.table_one import FIXED_DEPTHS_M, PAPER_TABLE, speed_cell, within_one_sd
from experiments.trackway.track_walk import walk_trackway
from experiments.trackway.walk import walk_of
from simulation.mud.clay import MUDS
from simulation.mud.track import COMPARTMENT_M

ARM_M = 0.12


@pytest.mark.parametrize("rule", FIXED_DEPTHS_M)
def test_a_walk_has_the_speeds_of_the_paper_within_one_standard_deviation(rule: str) -> None:
    """One trial each: the speeds of trials differ by less than 0.1 cm/s, the paper's by 0.3 to 1.0 cm/s."""
    walk = walk_of(walk_trackway(COMPARTMENT_M, 1, FIXED_DEPTHS_M[rule]))
    speeds = {mud: speed_cell([walk], mud, ARM_M)["mean"] for mud in MUDS}
    assert {mud: within_one_sd(speeds[mud], paper) for mud, paper in PAPER_TABLE[rule].items()} == dict.fromkeys(
        MUDS, True
    ), speeds
