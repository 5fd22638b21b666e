"""A plate on its arm in clay; its readings are compared with the clay's laws in test_load_cell_truth.py."""

from math import degrees, radians

import numpy as np
import pytest

from control.geometry import FlipperGeometry
from simulation.mud.clay import clay_of_water
from simulation.test_rig.joint_cell import JointCell, measure_stroke
from simulation.test_rig.load_cell import LoadCell

GEOMETRY = FlipperGeometry()
CLAY = clay_of_water(51.2)
SWEEP_RAD = radians(30.0)


def stiffness(depth_m: float) -> float:
    """Return the slope of the joint's moment in mud over the submerged volume's."""
    down, _ = measure_stroke(JointCell(CLAY, GEOMETRY, SWEEP_RAD, 0.0, 0.0), depth_m, 0.15)
    _, moments_m4, moments_nm = np.array(down).T
    return float(moments_m4 @ moments_nm / (moments_m4 @ moments_m4))


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


@pytest.mark.parametrize(("depth_m", "more"), [(0.03, 0.04), (0.04, 0.13), (0.05, 0.31)])
def test_pushed_straight_down_in_its_mean_attitude_the_same_plate_reads_more(depth_m: float, more: float) -> None:
    """Its face is pressed through the mud. (The increase is the same in all muds, to 1 %.)"""
    lift_rad = sum(GEOMETRY.adduction_rad(SWEEP_RAD, depth_m * (i + 0.5) / 50.0) for i in range(50)) / 50.0
    down, _ = measure_stroke(LoadCell(CLAY, GEOMETRY, SWEEP_RAD, lift_rad), depth_m, 0.15)
    _, volumes_m3, forces_n = np.array(down).T
    straight = volumes_m3 @ forces_n / (volumes_m3 @ volumes_m3)
    assert straight / stiffness(depth_m) == pytest.approx(1.0 + more, abs=0.01)
