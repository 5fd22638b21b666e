"""Measures time and travel of stops from full speed: soft stop, damping, and torque off.

The soft stop is the loop's own, requested in mid-stance of a walk in air. Damping is the law that follows a fault,
applied at the fastest point of a sweep. A joint without torque moves on until friction or a stop ends it, so torque is
switched off while the joint still accelerates, and its travel stays short. The measurement is how soon the current is
gone. Until then the same known torque is commanded in each of a few ticks: a drive that held its last command would
continue with it, and the current is seen even if a tick or message is late. Time is counted in tick numbers from the
last tick before the request, because the torque does not change in a missed tick.
"""

from collections.abc import Sequence
from math import nan, radians

import numpy as np

from control.controller import DAMPING_NM, RAISING_S, SOFT_STOP_S, measured_angles
from control.joint_pd import damping_torques_nm
from control.modes import Mode, Request
from control.rate import PERIOD_S
from control.records import FlipperJoints, Phase, same_for_all, same_for_each
from drivers.drive import DriveParameters
from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.stroke_tracking import FAST_RAD_S, order_strides
from experiments.bench.test_rig import TestRig, TickSample, first_lasting, signals

FULL_FRACTION = 0.9  # of the commanded speed: more counts as full speed
REST_RAD_S = 0.2
REST_TICKS = 20  # of slow motion in a row: no turning point
SWING_RAD = radians(30.0)
SOFT_REST_S = 0.3  # for the sweep to brake; the flippers rise in the same time
SOFT_TRAVEL_DEG = 15.0
SOFT_WHOLE_S = RAISING_S + 0.2  # raising takes half of it; then the loop waits as long for a flipper that is held down
DAMPED_REST_S = 0.2
DAMPED_TRAVEL_DEG = 8.0  # at 4 rad/s with 0.06 N·m s/rad and an arm of 0.0004 kg m²: 1.5, and arms that differ
OFF_TICKS = 4  # for command, decay of the current, and its message
QUIET_TICKS = 5  # in a row
QUIET_A = 0.4  # smaller currents are noise
STARTING = FlipperJoints(radians(-20.0), radians(-10.0))
PUSH_A = 1.5  # in each motor until torque is off: at 0.083 N·m/A more than twice the weight of an arm
PUSH_TICKS = 5  # in which a sweep reaches 4 rad/s and moves 2 degrees
COASTING_S = 1.5
COASTING_DEG = 60.0  # from the start to the stops
BRAKES = "raise the damping in [gains], and see what drives the joints on"


def check_soft_stop(test_rig: TestRig) -> BenchReadings:
    """Check the soft stop. The robot is idle before and after, as in all checks."""
    full_rad_s = test_rig.configuration.gait.stance_speed_m_s / test_rig.configuration.geometry.flipper_length_m
    with test_rig.flippers_raised():
        order_strides(test_rig, 2)
        last = test_rig.run_until(
            lambda sample: test_rig.loop.target.phase is Phase.STANCE and _is_fast(sample, FULL_FRACTION * full_rad_s),
            20.0,
            "The full speed of a stance",
        )[-1]
        test_rig.loop.request(Request.STOP, test_rig.rig.now_s)
        samples = test_rig.run_until(
            lambda sample: sample.mode is Mode.HOLD, SOFT_STOP_S + 1.0, "The end of a soft stop"
        )
    yield from _sweep_readings(test_rig, "soft stop", last, samples, SOFT_REST_S, SOFT_TRAVEL_DEG)
    whole_s = PERIOD_S * ticks_until(samples[-1], last)
    advice = "something holds the flippers down: see that they hang free"
    yield BenchReading("soft stop: until the flippers are up", whole_s, "s", 0.0, SOFT_WHOLE_S, advice)


def check_damping(test_rig: TestRig) -> BenchReadings:
    rig = test_rig.configuration.rig
    with test_rig.flippers_raised():
        test_rig.move([same_for_each(SWING_RAD, 0.0, rig)])
        test_rig.controller.follow_path([same_for_each(-SWING_RAD, 0.0, rig)], FAST_RAD_S)
        last = test_rig.run_until(
            lambda sample: _is_fast(sample, FULL_FRACTION * FAST_RAD_S), 2.0, "The full speed of a sweep"
        )[-1]
        gains, trusted = test_rig.configuration.gains, same_for_all(True, rig)
        test_rig.controller.hold_law = lambda held, states: damping_torques_nm(states, gains, trusted, DAMPING_NM)
        samples = test_rig.run_for(2.0 * DAMPED_REST_S)
        test_rig.hold_present_pose()
    yield from _sweep_readings(test_rig, "damping", last, samples, DAMPED_REST_S, DAMPED_TRAVEL_DEG)


def check_torque_off(test_rig: TestRig) -> BenchReadings:
    rig = test_rig.configuration.rig
    test_rig.raise_flippers()
    test_rig.move([same_for_each(*STARTING, rig)])
    constants_nm_a = test_rig.configuration.torque_constants_nm_a
    pushing_nm = constants_nm_a.map(lambda constant_nm_a: PUSH_A * constant_nm_a)  # forward and up
    test_rig.controller.hold_law = lambda held, states: pushing_nm
    pushed = test_rig.run_for(PUSH_TICKS * PERIOD_S)
    test_rig.loop.request(Request.DISARM, test_rig.rig.now_s)
    samples = [test_rig.tick() for _ in range(round(COASTING_S / PERIOD_S))]
    for index, joint in enumerate(rig.joints):
        yield from _off_readings(joint, test_rig.configuration.drive[joint], pushed, samples, index)
    advice = "see what drives it on"
    yield from _sweep_readings(test_rig, "torque off", pushed[-1], samples, COASTING_S, COASTING_DEG, advice)


def _off_readings(
    joint: str, drive: DriveParameters, pushed: Sequence[TickSample], samples: Sequence[TickSample], index: int
) -> BenchReadings:
    flowed_a = np.abs(signals(pushed, "current_a")[:, index]).max()
    few = f"{PUSH_A:g} A were commanded: see stage 4"
    yield BenchReading(f"{joint}: torque off, current before", flowed_a, "A", 2.0 * QUIET_A, 100.0, few)
    quiet = first_lasting(samples, np.abs(signals(samples, "current_a")[:, index]) < QUIET_A, QUIET_TICKS)
    advice = "the drive does not obey 'idle': have the power switch at hand, and check its firmware"
    ticks = ticks_until(quiet, pushed[-1]) - 1  # 'idle' leaves in the next one
    latest = OFF_TICKS + (round(drive.heartbeat_period_s / PERIOD_S) if drive.holds_idle_current else 0)
    yield BenchReading(f"{joint}: torque off, until no current flows", ticks, "ticks", 0, latest, advice)
    idle = next((sample for sample in samples if not sample.states[index].closed_loop), None)
    idle_s = PERIOD_S * ticks_until(idle, pushed[-1])
    latest_s = drive.heartbeat_period_s + OFF_TICKS * PERIOD_S
    yield BenchReading(f"{joint}: torque off, until it says so", idle_s, "s", 0.0, latest_s, advice)


def _is_fast(sample: TickSample, speed_rad_s: float) -> bool:
    return all(abs(sweep.velocity_rad_s) > speed_rad_s for sweep, _ in sample.states.flippers)


def _sweep_readings(
    test_rig: TestRig,
    name: str,
    last: TickSample,
    samples: Sequence[TickSample],
    longest_s: float,
    farthest_deg: float,
    advice: str = BRAKES,
) -> BenchReadings:
    """`last` is the sample before the request."""
    speeds_rad_s, paths_rad = signals(samples, "velocity_rad_s"), signals(samples, "angle_rad")
    paths_rad -= measured_angles(last.states)
    resting = first_lasting(samples, np.all(np.abs(speeds_rad_s[:, ::2]) < REST_RAD_S, axis=1), REST_TICKS)
    rest_s = PERIOD_S * ticks_until(resting, last)
    yield BenchReading(f"{name}: until the sweep rests", rest_s, "s", 0.0, longest_s, advice)
    paths_deg = np.degrees(np.max(np.abs(paths_rad[:, ::2]), axis=0))
    for flipper, path_deg in zip(test_rig.configuration.rig.flippers, paths_deg.tolist(), strict=True):
        yield BenchReading(f"{name}: travel of the {flipper} sweep", path_deg, "deg", 0.0, farthest_deg, advice)


def ticks_until(sample: TickSample | None, last: TickSample) -> float:
    """Count ticks from the last one before the request, with missed ones; NaN where it never happened."""
    return nan if sample is None else sample.tick.number - last.tick.number
