"""How long it takes to stop from full speed, and how far the flippers go on: soft stop, damping, and torque off.

The soft stop is the loop's own, asked for in mid-stance of a walk in air. Damping is the law that follows a fault,
put in at the fastest moment of a sweep. A joint without torque goes on until friction or a stop ends it, so torque is
taken off while it still speeds up, and its way stays short. What counts is how soon the current is gone. So one is
commanded until then that is known, the same in each of a few ticks: a drive that held its last command would go on
with it, and the current before is seen also where a tick or a message is late. Time is reckoned by the numbers of the
ticks, from the last one before the wish: torque stays as it is in a tick that is missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, nan, radians

from control.controller import ALL_TRUSTED, DAMPING_NM, RAISING_S, SOFT_STOP_S, HoldLaw, measured_angles
from control.joint_pd import damping_torques_nm
from control.modes import Mode, Request
from control.rate import PERIOD_S
from control.records import JOINTS, DriveStates, JointAngles, Joints, Phase, Torques
from drivers.drive import DriveParameters
from experiments.bench.reading import Reading, Readings
from experiments.bench.stroke_tracking import FAST_RAD_S, order_strides
from experiments.bench.test_rig import Sample, Stand, first_lasting

SWEEPS = (0, 2)  # places in JOINTS
FULL_FRACTION = 0.9  # of the speed asked for, from which on it counts as full
REST_RAD_S = 0.2
REST_TICKS = 20  # that all of them are slow: no turning point
SWING_RAD = radians(30.0)
SOFT_REST_S = 0.3  # of the sweep, which has only to brake; the flippers rise meanwhile
SOFT_TRAVEL_DEG = 15.0
SOFT_WHOLE_S = RAISING_S + 0.2  # the way up takes half of that; after it, the loop waits as long for what is held down
DAMPED_REST_S = 0.2
DAMPED_TRAVEL_DEG = 8.0  # at 4 rad/s with 0.06 N·m s/rad and an arm of 0.0004 kg m²: 1.5, and arms that differ
OFF_TICKS = 4  # of the commands' way, the current's end, and the message that tells it
QUIET_TICKS = 5  # in a row
QUIET_A = 0.4  # less than this is noise
STARTING = tuple(radians(angle_deg) for angle_deg in (-20.0, -10.0))  # sweep and adduction
PUSH_A = 1.5  # through each motor until torque is off: at 0.083 N·m/A more than twice what an arm weighs
PUSH_TICKS = 5  # in which a sweep comes to 4 rad/s and goes 2 degrees
COASTING_S = 1.5
COASTING_DEG = 60.0  # no farther than the stops from where it began


def soft_stop(stand: Stand) -> Readings:
    """Idle at the begin and at the end, as all of them."""
    with stand.raised():
        order_strides(stand, 2)
        last = stand.run_until(lambda sample: _in_full_stance(stand, sample), 20.0, "The full speed of a stance")[-1]
        begun = measured_angles(stand.loop.states)
        stand.loop.request(Request.STOP, stand.rig.now_s)
        samples = stand.run_until(lambda sample: sample.mode is Mode.HOLD, SOFT_STOP_S + 1.0, "The end of a soft stop")
    yield from _sweep_readings("soft stop", last, samples, begun, SOFT_REST_S, SOFT_TRAVEL_DEG)
    whole_s = PERIOD_S * ticks_until(samples[-1], last)
    advice = "something holds the flippers down: see that they hang free"
    yield Reading("soft stop: until the flippers are up", whole_s, "s", 0.0, SOFT_WHOLE_S, advice)


def _in_full_stance(stand: Stand, sample: Sample) -> bool:
    full_rad_s = stand.configuration.gait.stance_speed_m_s / stand.configuration.geometry.flipper_length_m
    in_stance = stand.loop.target.phase is Phase.STANCE
    return in_stance and all(abs(sample.states[place].velocity_rad_s) > FULL_FRACTION * full_rad_s for place in SWEEPS)


def damping(stand: Stand) -> Readings:
    with stand.raised():
        stand.move([_swept(SWING_RAD)])
        stand.controller.follow_path([_swept(-SWING_RAD)], FAST_RAD_S)
        last = stand.run_until(
            lambda sample: _is_fast(sample, FULL_FRACTION * FAST_RAD_S), 2.0, "The full speed of a sweep"
        )[-1]
        begun = measured_angles(stand.loop.states)
        stand.controller.hold_law = lambda held, states: _brake(stand, states)
        samples = stand.run_for(2.0 * DAMPED_REST_S)
        stand.hold_here()
    yield from _sweep_readings("damping", last, samples, begun, DAMPED_REST_S, DAMPED_TRAVEL_DEG)


def _brake(stand: Stand, states: DriveStates) -> Torques:
    return damping_torques_nm(states, stand.configuration.gains, ALL_TRUSTED, DAMPING_NM)


def torque_off(stand: Stand) -> Readings:
    stand.rise()
    sweep, adduction = STARTING
    stand.move([Joints(sweep, adduction, sweep, adduction)])
    stand.controller.hold_law = push(stand)
    pushed = stand.run_for(PUSH_TICKS * PERIOD_S)
    begun = stand.loop.states
    stand.loop.request(Request.DISARM, stand.rig.now_s)
    samples = [stand.tick() for _ in range(round(COASTING_S / PERIOD_S))]
    for place, joint in enumerate(JOINTS):
        yield from _off_readings(stand.configuration.drive[joint], pushed, samples, place)
    rest_s = PERIOD_S * ticks_until(first_slow(samples), pushed[-1])
    yield Reading("torque off: until the sweep rests", rest_s, "s", 0.0, COASTING_S, "see what drives it on")
    for place, side in zip(SWEEPS, ("left", "right"), strict=True):
        path_deg = degrees(max(abs(sample.states[place].angle_rad - begun[place].angle_rad) for sample in samples))
        yield Reading(
            f"torque off: way of the {side} sweep", path_deg, "deg", 0.0, COASTING_DEG, "see what drives it on"
        )


def push(stand: Stand) -> HoldLaw:
    """Forward and up, by the same current in each motor."""
    a, b, c, d = (PUSH_A * constant_nm_a for constant_nm_a in stand.configuration.torque_constants_nm_a)
    return lambda held, states: Joints(a, b, c, d)


def _off_readings(drive: DriveParameters, pushed: Sequence[Sample], samples: Sequence[Sample], place: int) -> Readings:
    joint, flowed_a = JOINTS[place], max(abs(sample.states[place].current_a) for sample in pushed)
    few = f"{PUSH_A:g} A were commanded: see stage 4"
    yield Reading(f"{joint}: torque off, current before", flowed_a, "A", 2.0 * QUIET_A, 100.0, few)
    quiet = first_lasting([abs(sample.states[place].current_a) < QUIET_A for sample in samples], QUIET_TICKS)
    advice = "the drive does not obey 'idle': have the power switch at hand, and check its firmware"
    ticks = ticks_until(None if quiet is None else samples[quiet], pushed[-1]) - 1  # 'idle' leaves in the next one
    yield Reading(f"{joint}: torque off, until no current flows", ticks, "ticks", 0, OFF_TICKS, advice)
    idle = next((sample for sample in samples if not sample.states[place].closed_loop), None)
    idle_s = PERIOD_S * ticks_until(idle, pushed[-1])
    latest_s = drive.heartbeat_period_s + OFF_TICKS * PERIOD_S
    yield Reading(f"{joint}: torque off, until it says so", idle_s, "s", 0.0, latest_s, advice)


def _swept(sweep_rad: float) -> JointAngles:
    return Joints(sweep_rad, 0.0, sweep_rad, 0.0)


def _is_fast(sample: Sample, speed_rad_s: float) -> bool:
    return all(abs(sample.states[place].velocity_rad_s) > speed_rad_s for place in SWEEPS)


def _sweep_readings(
    name: str, last: Sample, samples: Sequence[Sample], begun: JointAngles, longest_s: float, farthest_deg: float
) -> Readings:
    rest_s = PERIOD_S * ticks_until(first_slow(samples), last)
    brakes = "raise the damping in [gains], and see what drives the joints on"
    yield Reading(f"{name}: until the sweep rests", rest_s, "s", 0.0, longest_s, brakes)
    for place, side in zip(SWEEPS, ("left", "right"), strict=True):
        path_deg = degrees(max(abs(sample.states[place].angle_rad - begun[place]) for sample in samples))
        yield Reading(f"{name}: way of the {side} sweep", path_deg, "deg", 0.0, farthest_deg, brakes)


def first_slow(samples: Sequence[Sample]) -> Sample | None:
    """From which on all sweeps are slow, for a while."""
    slow = [all(abs(sample.states[place].velocity_rad_s) < REST_RAD_S for place in SWEEPS) for sample in samples]
    first = first_lasting(slow, REST_TICKS)
    return None if first is None else samples[first]


def ticks_until(sample: Sample | None, last: Sample) -> float:
    """From the last one before a wish, missed ones included; NaN where it never came to that."""
    return nan if sample is None else sample.tick.number - last.tick.number
