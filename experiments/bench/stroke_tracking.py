"""How well the joints follow a path in air: the largest error, its mean square, and by how much they come late.

The lag is where the measured angle fits the commanded one best (normalised cross-correlation without their means, and a
parabola through the best three ticks), so a constant error does not look like one. Where a joint leads it is negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.controller import WalkOrder
from control.gait.gait import stride_duration_s
from control.modes import Mode, Request
from control.rate import PERIOD_S
from control.records import JOINTS, JointAngles, Joints
from experiments.bench.lateness import BUSY
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Sample, Stand
from experiments.robot.bench_robot import BenchError
from firmware_host.operator.fault_texts import fault_message

Vector = NDArray[np.float64]

STROKE = tuple(radians(angle_deg) for angle_deg in (25.0, 15.0))  # sweep to either side, adduction up and down
FAST_RAD_S = 4.0  # of the stance of a usual walk
SLOW_RAD_S = 0.5
STROKES = 2  # there and back
MOST_LAG_TICKS = 15
SLOW_DEG = 2.0  # largest error: dry friction of 0.2 N·m against the stiffness makes 1.4
FAST_DEG = 6.0  # what is left to accelerate an arm with the usual gains
LAG_MS = 20.0  # beyond, the flipper is where the gait was 2 cm ago
STRIDES = 10
WALK_DEPTH_M = 0.02  # 2 cm above what the flippers lie on
WALK_DEG = 8.0  # in swing and extraction, which are faster than the strokes
MOST_MISSED_FRACTION = 0.001  # of ticks: a stray one does no harm, more and the computer is too slow
MOST_LIMITED_FRACTION = (
    0.005  # of ticks: where two phases meet, slew and torque limit take a few; in mud they take more
)


class Tracking(NamedTuple):
    """Of one joint."""

    max_deg: float
    rms_deg: float
    lag_ms: float


def stroke(stand: Stand, speed_rad_s: float) -> list[Sample]:
    """All joints to and fro about level."""
    sweep, adduction = STROKE
    front: JointAngles = Joints(sweep, adduction, sweep, adduction)
    back: JointAngles = Joints(-sweep, -adduction, -sweep, -adduction)
    samples = stand.move([front, back] * STROKES + [Joints(0.0, 0.0, 0.0, 0.0)], speed_rad_s)
    stand.run_for(0.3)
    return samples


def tracking(samples: Sequence[Sample]) -> dict[str, Tracking]:
    """By joint."""
    aimed = [(sample.aim, sample.states) for sample in samples if sample.aim is not None]
    result = {}
    for place, joint in enumerate(JOINTS):
        aims = np.array([aim[place] for aim, _ in aimed])
        angles = np.array([states[place].angle_rad for _, states in aimed])
        errors_rad = aims[:, 0] - angles
        rms_rad = float(np.sqrt(np.mean(errors_rad**2)))
        lag_ms = 1e3 * PERIOD_S * lag_ticks(aims[:, 0], angles)
        result[joint] = Tracking(degrees(float(np.abs(errors_rad).max())), degrees(rms_rad), lag_ms)
    return result


def lag_ticks(commanded: Vector, measured: Vector) -> float:
    """By how many ticks `measured` comes after `commanded`; NaN where nothing moves."""
    fits = np.array([_fit(commanded, measured, lag) for lag in range(-MOST_LAG_TICKS, MOST_LAG_TICKS + 1)])
    if not np.isfinite(fits).all():
        return float("nan")
    best = int(fits.argmax())
    if not 0 < best < 2 * MOST_LAG_TICKS:
        return float(best - MOST_LAG_TICKS)
    before, here, after = fits[best - 1 : best + 2]
    return best - MOST_LAG_TICKS + float((before - after) / (2.0 * (before - 2.0 * here + after)))


def _fit(commanded: Vector, measured: Vector, lag: int) -> float:
    end = len(commanded)
    a, b = commanded[max(0, -lag) : end - max(0, lag)], measured[max(0, lag) : end - max(0, -lag)]
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt(np.dot(a, a) * np.dot(b, b)))
    return float(np.dot(a, b)) / size if size else float("nan")


def stroke_readings(stand: Stand, name: str, speed_rad_s: float, most_deg: float) -> Readings:
    """Idle at the begin and at the end."""
    with stand.raised():
        samples = stroke(stand, speed_rad_s)
    gains = "check stiffness and damping in [gains], the drives' limits, and friction of the joint"
    for joint, (max_deg, rms_deg, lag_ms) in tracking(samples).items():
        yield Reading(f"{joint}: {name} stroke, largest error", max_deg, "deg", 0.0, most_deg, gains)
        yield Reading(f"{joint}: {name} stroke, error (RMS)", rms_deg, "deg", 0.0, most_deg / 2.0, gains)
        yield Reading(f"{joint}: {name} stroke, lag", lag_ms, "ms", -LAG_MS, LAG_MS, gains)


def strides(stand: Stand) -> Readings:
    """Ten of them, by the robot's own gait. Idle at the begin and at the end."""
    with stand.raised():
        missed = stand.loop.missed_ticks
        samples = walk(stand)
        fraction = 100.0 * (stand.loop.missed_ticks - missed) / len(samples)
        reported = [fault_message(fault) for fault in stand.loop.faults.present]
    yield from _walk_readings(stand, [sample for sample in samples if sample.mode is Mode.WALKING])
    yield Reading("walk: ticks missed", fraction, "%", 0.0, 100.0 * MOST_MISSED_FRACTION, BUSY)
    yield Reading("walk: faults that stand", len(reported), "", 0, 0, " ".join(reported))


def order_strides(stand: Stand, count: int) -> None:
    """In air. Raises BenchError."""
    refused = stand.loop.request(Request.WALK, stand.rig.now_s, WalkOrder(WALK_DEPTH_M, False, count))
    if refused:
        raise BenchError(f"The robot does not walk: {refused}")


def walk(stand: Stand) -> list[Sample]:
    """And back to hold."""
    order_strides(stand, STRIDES)
    longest_s = 2.0 * STRIDES * _stride_s(stand) + 10.0
    stand.run_until(lambda sample: sample.mode is Mode.WALKING, 1.0, "The walk")
    return stand.run_until(lambda sample: sample.mode is Mode.HOLD, longest_s, "The end of the walk")


def _stride_s(stand: Stand) -> float:
    return stride_duration_s(stand.configuration.gait, stand.configuration.geometry, WALK_DEPTH_M)


def _walk_readings(stand: Stand, walked: Sequence[Sample]) -> Readings:
    limited = 100.0 * sum(sample.limited for sample in walked) / len(walked)
    narrow = "see that nothing meets the flippers; else widen [limits] or slow down the gait: the torque was cut"
    yield Reading("walk: ticks with limited torque", limited, "%", 0.0, 100.0 * MOST_LIMITED_FRACTION, narrow)
    most_nm = max(abs(torque_nm) for sample in walked for torque_nm in sample.sent_nm)
    yield Reading("walk: largest torque", most_nm, "N·m", 0.0, stand.configuration.limits.torque_nm, narrow)
    for joint, (max_deg, rms_deg, lag_ms) in tracking(walked).items():
        advice = "compare with the strokes before: mechanics or gains"
        yield Reading(f"{joint}: walk, largest error", max_deg, "deg", 0.0, WALK_DEG, advice)
        yield Reading(f"{joint}: walk, error (RMS)", rms_deg, "deg", 0.0, WALK_DEG / 2.0, advice)
        yield Reading(f"{joint}: walk, lag", lag_ms, "ms", -LAG_MS, LAG_MS, advice)
    for place, (joint, span) in enumerate(zip(JOINTS, stand.configuration.joint_ranges, strict=True)):
        angles = [sample.states[place].angle_rad for sample in walked]
        room_deg = degrees(min(span.max_rad - max(angles), min(angles) - span.min_rad))
        yield Reading(f"{joint}: walk, room to the limits", room_deg, "deg", 1.0, 180.0, "widen [limits] or sweep less")
