"""Checks encoder zeros and limits without torque: against the geometry, flippers held level by hand, and the stops."""

from itertools import pairwise
from math import degrees, fsum, inf

from control.controller import measured_angles
from control.records import JointAngles, Joints
from experiments.bench.reading import Reading, Readings, left_out
from experiments.bench.stroke_tracking import WALK_DEPTH_M
from experiments.bench.test_rig import POLL_S, Sample, TestRig

LEVEL_DEG = 5.0  # error of a hand with a spirit level: 1 cm at the end of an arm
LEAST_TURN_DEG = 30.0  # a joint turned on purpose moves more
OTHERS_FRACTION = 0.5  # motion of another joint with it, since a hand does not hold it still
LYING_M = 0.02  # height difference of two flippers on the same table: 1 cm for each zero and table
LOOKING_S = 0.3
ZERO = "set drive.{joint}.zero_turn so that the joint reads 0 with the flipper straight out and level"


def check_rest_pose(test_rig: TestRig) -> Readings:
    """Check that idle flippers are within the limits, low enough for strides in air, and equally low."""
    rig, angles = test_rig.configuration.rig, _mean_angles(test_rig.run_for(LOOKING_S))
    for joint, angle_rad, span in zip(rig.joints, angles, test_rig.configuration.joint_ranges, strict=True):
        advice = f"lay the flipper within its limits (on blocks, or a lower support); else {ZERO.format(joint=joint)}"
        low_deg, high_deg = degrees(span.min_rad), degrees(span.max_rad)
        yield Reading(f"{joint}: at rest", degrees(angle_rad), "deg", low_deg, high_deg, advice)
    geometry = test_rig.configuration.geometry
    stride_m = geometry.axis_height_m + WALK_DEPTH_M
    heights_m = [geometry.edge_position(*pose)[2] for pose in angles.flippers]
    for side, height_m in zip(rig.flippers, heights_m, strict=True):
        low = "put the robot on blocks: its strides in air go as low"
        advice = f"{low}; where the flipper lies low enough, {ZERO.format(joint=f'{side}_adduction')}"
        yield Reading(f"{side} flipper: edge above the axis, at rest", height_m, "m", -inf, -stride_m, advice)
    advice = "lay both on the same level; else set the zeros of the adduction joints again"
    for (side, above_m), (other, below_m) in pairwise(zip(rig.flippers, heights_m, strict=True)):
        what = f"{side} flipper lies above the {other} one by"
        yield Reading(what, above_m - below_m, "m", -LYING_M, LYING_M, advice)


def check_level_pose(test_rig: TestRig) -> Readings:
    """Check that all joints read zero while the flippers are held level."""
    if not test_rig.operator.hold_level(test_rig.run_during_prompt):
        yield left_out("flippers held level by hand")
        return
    angles = _mean_angles(test_rig.run_for(LOOKING_S))
    test_rig.operator.release_flippers()
    for joint, angle_rad in zip(test_rig.configuration.rig.joints, angles, strict=True):
        what = f"{joint}: held level and straight out"
        yield Reading(what, degrees(angle_rad), "deg", -LEVEL_DEG, LEVEL_DEG, ZERO.format(joint=joint))


def check_turning(test_rig: TestRig, joint: str) -> Readings:
    """Check that the turned joint moves most, and that its limits are within the stops."""
    seen = [_mean_angles(test_rig.run_for(POLL_S))]
    if not test_rig.operator.turn_joint(joint, lambda: seen.extend(map(_angles, test_rig.run_for(POLL_S)))):
        yield left_out(f"{joint}: turned by hand")
        return
    test_rig.operator.release_flippers()
    turns_deg = [degrees(max(angles) - min(angles)) for angles in zip(*seen, strict=True)]
    joints, index = test_rig.configuration.rig.joints, test_rig.index_of(joint)
    turn_deg = turns_deg.pop(index)
    other_deg, other = max(zip(turns_deg, [other for other in joints if other != joint], strict=True))
    mixed = f"{other} turned instead: exchange the node ids (or the bus) of the two"
    advice = mixed if other_deg > turn_deg else "turn it farther"
    yield Reading(f"{joint}: turned by hand", turn_deg, "deg", LEAST_TURN_DEG, inf, advice)
    alone = advice if other_deg > turn_deg else "turn one joint at a time"
    yield Reading(f"{joint}: {other} turned with it", other_deg, "deg", 0.0, OTHERS_FRACTION * turn_deg, alone)
    span = test_rig.configuration.joint_ranges[index]
    low_deg, high_deg = degrees(min(angles[index] for angles in seen)), degrees(max(angles[index] for angles in seen))
    narrow = f"the limit lies beyond the stop: narrow [limits], or {ZERO.format(joint=joint)}"
    yield Reading(f"{joint}: lower stop", low_deg, "deg", -inf, degrees(span.min_rad), narrow)
    yield Reading(f"{joint}: upper stop", high_deg, "deg", degrees(span.max_rad), inf, narrow)


def _angles(sample: Sample) -> JointAngles:
    return measured_angles(sample.states)


def _mean_angles(samples: list[Sample]) -> JointAngles:
    return Joints(*(fsum(angles) / len(samples) for angles in zip(*map(_angles, samples), strict=True)))
