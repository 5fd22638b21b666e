"""Checks encoder zeros and limits without torque: against the geometry, flippers held level by hand, and the stops."""

from itertools import pairwise
from math import degrees, inf

import numpy as np
from numpy.typing import NDArray

from experiments.bench.reading import BenchReading, BenchReadings, left_out
from experiments.bench.stroke_tracking import WALK_DEPTH_M
from experiments.bench.test_rig import POLL_S, TestRig, TickSample, signals

LEVEL_DEG = 5.0  # error of a hand with a spirit level: 1 cm at the end of an arm
LEAST_TURN_DEG = 30.0  # a joint turned on purpose moves more
OTHERS_FRACTION = 0.5  # motion of another joint with it, since a hand does not hold it still
LYING_M = 0.02  # height difference of two flippers on the same table: 1 cm for each zero and table
LOOKING_S = 0.3
ZERO = "set drive.{joint}.zero_turn so that the joint reads 0 with the flipper straight out and level"


def check_rest_pose(test_rig: TestRig) -> BenchReadings:
    """Check that idle flippers are within the limits, low enough for strides in air, and equally low."""
    configuration, angles_rad = test_rig.configuration, _mean_angles_rad(test_rig)
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


def check_level_pose(test_rig: TestRig) -> BenchReadings:
    """Check that all joints read zero while the flippers are held level."""
    if not test_rig.operator.hold_level(test_rig.run_during_prompt):
        yield left_out("flippers held level by hand")
        return
    angles_deg = np.degrees(_mean_angles_rad(test_rig))
    test_rig.operator.release_flippers()
    for joint, angle_deg in zip(test_rig.configuration.rig.joints, angles_deg, strict=True):
        what = f"{joint}: held level and straight out"
        yield BenchReading(what, angle_deg, "deg", -LEVEL_DEG, LEVEL_DEG, ZERO.format(joint=joint))


def check_turning(test_rig: TestRig, joint: str) -> BenchReadings:
    """Check that the turned joint moves most, and that its limits are within the stops."""
    seen: list[TickSample] = test_rig.run_for(POLL_S)
    if not test_rig.operator.turn_joint(joint, lambda: seen.extend(test_rig.run_for(POLL_S))):
        yield left_out(f"{joint}: turned by hand")
        return
    test_rig.operator.release_flippers()
    angles_deg = np.degrees(signals(seen, "angle_rad"))
    turns_deg = dict(zip(test_rig.configuration.rig.joints, np.ptp(angles_deg, axis=0).tolist(), strict=True))
    turn_deg, index = turns_deg.pop(joint), test_rig.index_of(joint)
    other = max(turns_deg, key=turns_deg.__getitem__)
    mixed = f"{other} turned instead: exchange the node ids (or the bus) of the two"
    is_mixed = turns_deg[other] > turn_deg
    advice = mixed if is_mixed else "turn it farther"
    yield BenchReading(f"{joint}: turned by hand", turn_deg, "deg", LEAST_TURN_DEG, inf, advice)
    alone, what = mixed if is_mixed else "turn one joint at a time", f"{joint}: {other} turned with it"
    yield BenchReading(what, turns_deg[other], "deg", 0.0, OTHERS_FRACTION * turn_deg, alone)
    least_deg, most_deg = map(degrees, test_rig.configuration.joint_ranges[index])
    narrow = f"the limit lies beyond the stop: narrow [limits], or {ZERO.format(joint=joint)}"
    yield BenchReading(f"{joint}: lower stop", float(angles_deg[:, index].min()), "deg", -inf, least_deg, narrow)
    yield BenchReading(f"{joint}: upper stop", float(angles_deg[:, index].max()), "deg", most_deg, inf, narrow)


def _mean_angles_rad(test_rig: TestRig) -> NDArray[np.float64]:
    return np.asarray(np.mean(signals(test_rig.run_for(LOOKING_S), "angle_rad"), axis=0))
