"""A plate on its arm in clay; test_load_cell.py compares the readings of one with the clay's laws."""

from math import degrees, radians

import pytest

from control.geometry import FlipperGeometry
from simulation.mud.clay import clay_of_water
from simulation.test_rig.joint_cell import JointCell, measure_stroke

GEOMETRY = FlipperGeometry()
CLAY = clay_of_water(51.2)
SWEEP_RAD = radians(30.0)


def test_mud_pushes_an_inserted_plate_up_and_an_extracted_one_down_and_air_does_neither() -> None:
    down, up = measure_stroke(JointCell(CLAY, GEOMETRY, SWEEP_RAD, 0.002, 0.0), 0.03, 0.1, hold_s=0.1)
    assert down[-1][0] == pytest.approx(0.03)
    assert min(lifting_nm for *_, lifting_nm in down[-100:]) > 0.0
    assert max(lifting_nm for z, _, lifting_nm in up if 0.0 < z < 0.02) < 0.0
    air = {row[1:] for row in (*down, *up) if row[0] < -0.005}
    assert air == {(0.0, 0.0)}  # even the lowest corner is out of the mud


def test_a_depth_beyond_the_arm_s_reach_ends_at_its_reach() -> None:
    """The depth is below the surface, which lies 2 mm below its nominal height."""
    down, _ = measure_stroke(JointCell(CLAY, GEOMETRY, SWEEP_RAD, 0.002, 0.0), 0.08, 0.1)
    assert down[-1][0] == pytest.approx(GEOMETRY.deepest_m(degrees(SWEEP_RAD)) - 0.002)
