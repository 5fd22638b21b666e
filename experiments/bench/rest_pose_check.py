"""Checks without torque and without hands that idle flippers lie where they may, by the configured geometry."""

from itertools import pairwise
from math import degrees, inf

import numpy as np

from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.stroke_tracking import WALK_DEPTH_M
from experiments.bench.test_rig import TestRig, signals

LYING_M = 0.02  # height difference of two flippers on the same table: 1 cm for each zero and table
LOOKING_S = 0.3
ZERO = "set drive.{joint}.zero_turn so that the joint reads 0 with the flipper straight out and level"


def check_rest_pose(test_rig: TestRig) -> BenchReadings:
    """Check that idle flippers are within the limits, low enough for strides in air, and equally low."""
    configuration = test_rig.configuration
    angles_rad = np.mean(signals(test_rig.run_for(LOOKING_S), "angle_rad"), axis=0)
    rig, geometry = configuration.rig, configuration.geometry
    for joint, angle_rad, span in zip(rig.joints, angles_rad.tolist(), configuration.joint_ranges, strict=True):
        advice = f"lay the flipper within its limits (on blocks, or a lower support); else {ZERO.format(joint=joint)}"
        low_deg, high_deg = map(degrees, span)
        yield BenchReading(f"{joint}: at rest", degrees(angle_rad), "deg", low_deg, high_deg, advice)
    stride_m = geometry.axis_height_m + WALK_DEPTH_M
    heights_m = [geometry.edge_position(*pose)[2] for pose in angles_rad.reshape(-1, 2).tolist()]
    for side, height_m in zip(rig.flippers, heights_m, strict=True):
        low = "put the robot on blocks: its strides in air go as low"
        advice = f"{low}; where the flipper lies low enough, {ZERO.format(joint=f'{side}_adduction')}"
        yield BenchReading(f"{side} flipper: edge above the axis, at rest", height_m, "m", -inf, -stride_m, advice)
    advice = "lay both on the same level; else set the zeros of the adduction joints again"
    for (side, above_m), (other, below_m) in pairwise(zip(rig.flippers, heights_m, strict=True)):
        what = f"{side} flipper lies above the {other} one by"
        yield BenchReading(what, above_m - below_m, "m", -LYING_M, LYING_M, advice)
