"""Samples get the requested latency between current and angle, and no other change."""

from math import cos, sin
from statistics import fmean

import pytest

from control.rate import PERIOD_S
from control.records import BodyPose, DriveState, Phase, same_for_all
from experiments.trials.trial import Sample, with_latency

RATE_RAD_S = 3.0


def swinging(ticks: int = 400) -> list[Sample]:
    """Return samples whose current is in phase with the angle; messages come half a millisecond before the tick."""
    samples = []
    for tick in range(ticks):
        now_s = tick * PERIOD_S
        stamp_s = now_s - 0.0005
        angle_rad, velocity_rad_s = sin(RATE_RAD_S * stamp_s), RATE_RAD_S * cos(RATE_RAD_S * stamp_s)
        state = DriveState(angle_rad, velocity_rad_s, stamp_s, 2.0 * angle_rad, stamp_s)
        samples.append(Sample(now_s, Phase.SWING, same_for_all(state), BodyPose()))
    return samples


def latency_of(samples: list[Sample]) -> float:
    """Return the delay δ of the current after the angle, fitted to I - 2 θ = -2 θ' δ by least squares."""
    states = [sample.states.flippers[1].adduction for sample in samples[10:]]
    slopes = [-2.0 * state.velocity_rad_s for state in states]
    lags = [state.current_a - 2.0 * state.angle_rad for state in states]
    return fmean(a * b for a, b in zip(slopes, lags, strict=True)) / fmean(slope * slope for slope in slopes)


@pytest.mark.parametrize("ticks", [-2, -1, 0, 1, 2])
def test_the_latency_is_found_again(ticks: int) -> None:
    late = with_latency(swinging(), ticks * PERIOD_S)
    assert latency_of(late) == pytest.approx(ticks * PERIOD_S, rel=0.01, abs=1e-9)


@pytest.mark.parametrize(("late_s", "late", "prompt"), [(0.005, (3, 4), (0, 1, 2)), (-0.005, (0, 1, 2), (3, 4))])
def test_late_signals_have_the_time_of_their_arrival_and_the_others_stay(
    late_s: float, late: tuple[int, ...], prompt: tuple[int, ...]
) -> None:
    before, after = swinging(), with_latency(swinging(), late_s)
    for number in range(2, len(before)):
        was, earlier, now = (
            samples.states.flippers[0].sweep for samples in (before[number], before[number - 2], after[number])
        )
        assert all(now[field] == was[field] for field in prompt)
        assert now[late[0]] == earlier[late[0]]
        stamp = late[-1]
        assert now[stamp] == pytest.approx(was[stamp])
        assert after[number][:2] == before[number][:2]
