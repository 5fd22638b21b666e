"""Encoder zeros and limits, without torque: against the geometry, against hands that hold the flippers level, and
against the stops between which hands can turn each joint.
"""

from __future__ import annotations

from math import degrees, inf

from control.controller import measured_angles
from control.records import JOINTS, JointAngles, Joints
from experiments.bench.reading import Reading, Readings, left_out
from experiments.bench.stroke_tracking import WALK_DEPTH_M
from experiments.bench.test_rig import LOOK_S, Sample, Stand, joint_place

LEVEL_DEG = 5.0  # that hands with a spirit level are off: 1 cm at the end of an arm
LEAST_TURN_DEG = 30.0  # by which a joint is turned by somebody who means it
OTHERS_FRACTION = 0.5  # that another joint may turn with it: a hand is not a vice
LYING_M = 0.02  # two flippers that lie on the same table: 1 cm of each for zero and table
LOOKING_S = 0.3
ZERO = "set drive.{joint}.zero_turn so that the joint reads 0 with the flipper straight out and level"


def rest_pose(stand: Stand) -> Readings:
    """Where the flippers lie without torque: within the limits, below the strides in air to come, both as low."""
    angles = _mean_angles(stand.run_for(LOOKING_S))
    for joint, angle_rad, span in zip(JOINTS, angles, stand.configuration.joint_ranges, strict=True):
        advice = f"lay the flipper within its limits (on blocks, or a lower stand); else {ZERO.format(joint=joint)}"
        low_deg, high_deg = degrees(span.min_rad), degrees(span.max_rad)
        yield Reading(f"{joint}: at rest", degrees(angle_rad), "deg", low_deg, high_deg, advice)
    geometry = stand.configuration.geometry
    stride_m = geometry.axis_height_m + WALK_DEPTH_M
    left_m, right_m = (geometry.edge_position(*angles[place : place + 2])[2] for place in (0, 2))
    for side, height_m in (("left", left_m), ("right", right_m)):
        low = "put the robot on blocks: its strides in air go as low"
        advice = f"{low}; where the flipper lies low enough, {ZERO.format(joint=f'{side}_adduction')}"
        yield Reading(f"{side} flipper: edge above the axis, at rest", height_m, "m", -inf, -stride_m, advice)
    advice = "lay both on the same level; else set the zeros of the adduction joints anew"
    yield Reading("left flipper lies above the right one by", left_m - right_m, "m", -LYING_M, LYING_M, advice)


def level_pose(stand: Stand) -> Readings:
    """Held by hand, all four read zero."""
    if not stand.attendant.holds_level(stand.look_on):
        yield left_out("flippers held level by hand")
        return
    angles = _mean_angles(stand.run_for(LOOKING_S))
    stand.attendant.lets_go()
    for joint, angle_rad in zip(JOINTS, angles, strict=True):
        what = f"{joint}: held level and straight out"
        yield Reading(what, degrees(angle_rad), "deg", -LEVEL_DEG, LEVEL_DEG, ZERO.format(joint=joint))


def turned(stand: Stand, joint: str) -> Readings:
    """By hand, from stop to stop: that joint turns most, and its limits lie within the stops."""
    seen = [_mean_angles(stand.run_for(LOOK_S))]
    if not stand.attendant.turns(joint, lambda: seen.extend(map(_angles, stand.run_for(LOOK_S)))):
        yield left_out(f"{joint}: turned by hand")
        return
    stand.attendant.lets_go()
    turns_deg = [degrees(max(angles) - min(angles)) for angles in zip(*seen, strict=True)]
    place = joint_place(joint)
    turn_deg = turns_deg.pop(place)
    other_deg, other = max(zip(turns_deg, [other for other in JOINTS if other != joint], strict=True))
    mixed = f"{other} turned instead: exchange the node ids (or the bus) of the two"
    advice = mixed if other_deg > turn_deg else "turn it farther"
    yield Reading(f"{joint}: turned by hand", turn_deg, "deg", LEAST_TURN_DEG, inf, advice)
    alone = advice if other_deg > turn_deg else "turn one joint at a time"
    yield Reading(f"{joint}: {other} turned with it", other_deg, "deg", 0.0, OTHERS_FRACTION * turn_deg, alone)
    span = stand.configuration.joint_ranges[place]
    low_deg, high_deg = degrees(min(angles[place] for angles in seen)), degrees(max(angles[place] for angles in seen))
    narrow = f"the limit lies beyond the stop: narrow [limits], or {ZERO.format(joint=joint)}"
    yield Reading(f"{joint}: lower stop", low_deg, "deg", -inf, degrees(span.min_rad), narrow)
    yield Reading(f"{joint}: upper stop", high_deg, "deg", degrees(span.max_rad), inf, narrow)


def _angles(sample: Sample) -> JointAngles:
    return measured_angles(sample.states)


def _mean_angles(samples: list[Sample]) -> JointAngles:
    a, b, c, d = (sum(angles) / len(samples) for angles in zip(*map(_angles, samples), strict=True))
    return Joints(a, b, c, d)
