"""Measures how well the joints follow a path in air: largest error, root mean square error, and lag.

The lag is the shift with the best fit of the measured to the commanded angle (normalised cross-correlation without the
means, and a parabola through the best three ticks), so a constant error is no lag. It is negative where a joint leads.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import degrees, fsum, radians

import numpy as np
from numpy.typing import NDArray

from control.controller import WalkOrder
from control.faults import FaultKind
from control.gait.stride_table import stride_duration_s
from control.modes import Mode, Request
from control.rate import PERIOD_S
from control.records import FlipperJoints, JointAngles, Rig, same_for_each
from experiments.bench.lateness import BUSY
from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.test_rig import TestRig, TickSample, signals
from experiments.robot.bench_errors import BenchError

Vector = NDArray[np.float64]

STROKE = FlipperJoints(radians(25.0), radians(15.0))  # sweep to either side, adduction up and down
FAST_RAD_S = 4.0  # of the stance of a usual walk
SLOW_RAD_S = 0.5
STROKES = 2  # there and back
MOST_LAG_TICKS = 15
SLOPE_TICKS = 20  # in which a fast stroke turns by 0.2 rad: a code of 0.4 mrad and the noise are 1 % of it
SLOPE_FRACTION = 0.03  # of a mean over a stroke; ranges of two firmwares differ by 10 % and more
SLOW_DEG = 2.0  # largest error: dry friction of 0.2 N·m against the stiffness causes 1.4
FAST_DEG = 6.0  # error to accelerate an arm with the usual gains
LAG_MS = 20.0  # with more, the flipper lags the gait by 2 cm
STRIDES = 10
WALK_DEPTH_M = 0.02  # 2 cm above the support of the flippers
WALK_DEG = 8.0  # in swing and extraction, which are faster than the strokes
MOST_MISSED_FRACTION = 0.001  # of ticks: more, and the computer is too slow
MOST_LIMITED_FRACTION = 0.005  # of ticks: where two phases meet, limits take a few; in mud they take more


def lag_ticks(commanded: Vector, measured: Vector) -> float:
    """Return by how many ticks `measured` lags `commanded`; NaN without motion."""
    fits = np.array([_correlation(commanded, measured, lag) for lag in range(-MOST_LAG_TICKS, MOST_LAG_TICKS + 1)])
    if not np.isfinite(fits).all():
        return float("nan")
    best = int(fits.argmax())
    if not 0 < best < 2 * MOST_LAG_TICKS:
        return float(best - MOST_LAG_TICKS)
    before, here, after = fits[best - 1 : best + 2]
    return best - MOST_LAG_TICKS + float((before - after) / (2.0 * (before - 2.0 * here + after)))


def _correlation(commanded: Vector, measured: Vector, lag: int) -> float:
    end = len(commanded)
    a, b = commanded[max(0, -lag) : end - max(0, lag)], measured[max(0, lag) : end - max(0, -lag)]
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.corrcoef(a, b)[0, 1])


def velocity_scale(stretches: Iterable[Sequence[TickSample]], index: int) -> float:
    """Return the turned angle divided by the integral of the reported velocity, by least squares over stretches.

    It is 0 where nothing turned.
    """
    products = squares = 0.0
    for stretch in stretches:
        states = [sample.states[index] for sample in stretch]
        turned_rad = states[-1].angle_rad - states[0].angle_rad
        reported_rad = fsum(
            (a.velocity_rad_s + b.velocity_rad_s) / 2.0 * (b.angle_stamp_s - a.angle_stamp_s)
            for a, b in pairwise(states)
        )
        products += turned_rad * reported_rad
        squares += reported_rad * reported_rad
    return products / squares if squares else 0.0


def check_stroke(test_rig: TestRig, name: str, speed_rad_s: float, most_deg: float) -> BenchReadings:
    """Check a motion of all joints to and fro about level. The robot is idle before and after."""
    front: JointAngles = same_for_each(*STROKE, test_rig.configuration.rig)
    back = front.map(lambda angle_rad: -angle_rad)
    with test_rig.flippers_raised():
        samples = test_rig.move([front, back] * STROKES + [test_rig.level], speed_rad_s)
        test_rig.run_for(0.3)
    gains = "check stiffness and damping in [gains], the drives' limits, and friction of the joint"
    yield from _tracking_readings(test_rig.configuration.rig, f"{name} stroke", samples, most_deg, gains)
    if speed_rad_s >= FAST_RAD_S:
        yield from _velocity_readings(test_rig.configuration.rig, samples)


def _velocity_readings(rig: Rig, samples: Sequence[TickSample]) -> BenchReadings:
    """Compare each reported velocity with the slope of the reported angle: its scale may be another firmware's."""
    low, high = 1.0 - SLOPE_FRACTION, 1.0 + SLOPE_FRACTION
    advice = "its velocity has another scale than its angle: correct velocity_range_rad_s or the drive's own setting"
    stretches = [samples[i : i + SLOPE_TICKS + 1] for i in range(len(samples) - SLOPE_TICKS)]
    for index, joint in enumerate(rig.joints):
        what = f"{joint}: slope of its angle by its velocity"
        yield BenchReading(what, velocity_scale(stretches, index), "1", low, high, advice)


def _tracking_readings(
    rig: Rig, motion: str, samples: Sequence[TickSample], most_deg: float, advice: str
) -> BenchReadings:
    aimed = [sample for sample in samples if sample.aim is not None]
    aims_rad = np.array([[target.angle_rad for target in sample.aim or ()] for sample in aimed])
    angles_rad = signals(aimed, "angle_rad")
    for joint, aim_rad, angle_rad in zip(rig.joints, aims_rad.T, angles_rad.T, strict=True):
        errors_deg, lag_ms = np.degrees(aim_rad - angle_rad), 1e3 * PERIOD_S * lag_ticks(aim_rad, angle_rad)
        max_deg, rms_deg = np.abs(errors_deg).max(), np.sqrt(np.mean(errors_deg**2))
        yield BenchReading(f"{joint}: {motion}, largest error", max_deg, "deg", 0.0, most_deg, advice)
        yield BenchReading(f"{joint}: {motion}, error (RMS)", rms_deg, "deg", 0.0, most_deg / 2.0, advice)
        yield BenchReading(f"{joint}: {motion}, lag", lag_ms, "ms", -LAG_MS, LAG_MS, advice)


def check_strides(test_rig: TestRig) -> BenchReadings:
    """Check ten strides of the robot's own gait. The robot is idle before and after."""
    with test_rig.flippers_raised():
        missed = test_rig.loop.missed_ticks
        order_strides(test_rig, STRIDES)
        stride_s = stride_duration_s(test_rig.configuration.gait, test_rig.configuration.geometry, WALK_DEPTH_M)
        test_rig.run_until(lambda sample: sample.mode is Mode.WALKING, 1.0, "The walk")
        longest_s = 2.0 * STRIDES * stride_s + 10.0
        samples = test_rig.run_until(lambda sample: sample.mode is Mode.HOLD, longest_s, "The end of the walk")
        fraction = 100.0 * (test_rig.loop.missed_ticks - missed) / len(samples)
        overruled = {FaultKind.WATCHDOG_UNKNOWN} if test_rig.forced else set()
        reported = [fault.message for fault in test_rig.loop.faults.present if fault.kind not in overruled]
    yield from _walk_readings(test_rig, [sample for sample in samples if sample.mode is Mode.WALKING])
    yield BenchReading("walk: ticks missed", fraction, "%", 0.0, 100.0 * MOST_MISSED_FRACTION, BUSY)
    yield BenchReading("walk: faults at its end", len(reported), "", 0, 0, " ".join(reported))


def order_strides(test_rig: TestRig, count: int) -> None:
    """Order strides in air. Raises BenchError."""
    refused = test_rig.loop.request(Request.WALK, test_rig.rig.now_s, WalkOrder(WALK_DEPTH_M, False, count))
    if refused:
        raise BenchError(f"The robot does not walk: {refused}")


def _walk_readings(test_rig: TestRig, walked: Sequence[TickSample]) -> BenchReadings:
    limited = 100.0 * sum(sample.limited for sample in walked) / len(walked)
    narrow = "see that nothing meets the flippers; else widen [limits] or slow down the gait: the torque was cut"
    yield BenchReading("walk: ticks with limited torque", limited, "%", 0.0, 100.0 * MOST_LIMITED_FRACTION, narrow)
    most_nm = max(abs(torque_nm) for sample in walked for torque_nm in sample.sent_nm)
    yield BenchReading("walk: largest torque", most_nm, "N·m", 0.0, test_rig.configuration.limits.torque_nm, narrow)
    rig, worse = test_rig.configuration.rig, "compare with the strokes before: mechanics or gains"
    yield from _tracking_readings(rig, "walk", walked, WALK_DEG, worse)
    angles_rad = signals(walked, "angle_rad")
    for index, (joint, span) in enumerate(zip(rig.joints, test_rig.configuration.joint_ranges, strict=True)):
        room_rad = min(span.max_rad - angles_rad[:, index].max(), angles_rad[:, index].min() - span.min_rad)
        what, widen = f"{joint}: walk, room to the limits", "widen [limits] or sweep less"
        yield BenchReading(what, degrees(room_rad), "deg", 1.0, 180.0, widen)
