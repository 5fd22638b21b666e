"""Latency between the current and the angle of a sample, as a log holds whose drives report one later than the other.

It disturbs the samples, not the control. The authors' rows change angles and currents together, so a difference within
a gap between their 50 to 210 distinct states a second cannot be seen in a log. Eight values are read one after another
in such a gap, so those of one joint are at most half of it apart: 2.6 ms at 190 a second.
"""

from collections.abc import Sequence
from random import Random
from typing import NamedTuple

from control.rate import PERIOD_S
from control.records import BodyPose, DriveState, DriveStates, Phase

LATENCY_S = 0.0026  # the largest


class Sample(NamedTuple):
    """The estimator's input in one tick."""

    now_s: float
    phase: Phase
    states: DriveStates
    body: BodyPose


def drawn_latency_s(largest_s: float, seed: int) -> float:
    """Draw the latency of one trial: positive where currents are late, negative where angles are."""
    return Random(f"latency {seed}").uniform(-largest_s, largest_s)


def with_latency(samples: Sequence[Sample], current_late_s: float) -> list[Sample]:
    """Return the samples with late currents, or with late angles where it is negative, to the nearest tick."""
    ticks = round(abs(current_late_s) / PERIOD_S)
    late = _with_late_current if current_late_s > 0.0 else _with_late_angle
    if not ticks:
        return list(samples)
    delayed = []
    for number, sample in enumerate(samples):
        earlier = samples[max(0, number - ticks)]
        pairs = zip(sample.states, earlier.states, strict=True)
        delay_s = sample.now_s - earlier.now_s
        delayed.append(sample._replace(states=DriveStates(*(late(*pair, delay_s) for pair in pairs))))
    return delayed


def _with_late_current(state: DriveState, earlier: DriveState, delay_s: float) -> DriveState:
    """Return the state with the current of an earlier one, stamped with its late arrival."""
    return state._replace(current_a=earlier.current_a, current_stamp_s=earlier.current_stamp_s + delay_s)


def _with_late_angle(state: DriveState, earlier: DriveState, delay_s: float) -> DriveState:
    stamp_s = earlier.angle_stamp_s + delay_s
    return state._replace(angle_rad=earlier.angle_rad, velocity_rad_s=earlier.velocity_rad_s, angle_stamp_s=stamp_s)
