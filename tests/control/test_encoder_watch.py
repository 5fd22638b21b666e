"""Encoders that jump and that stand still, told from joints that are quick, at rest, or held by the mud."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sin
from random import Random

import pytest

from control.encoder_watch import FROZEN_S, GONE_RAD, GONE_S, EncoderWatch
from control.records import DriveState

PERIOD_S = 0.002
TICK_S = 1.0 / 380.0
JUMP_RAD, FASTEST_RAD_S = 0.05, 40.0
COUNT_RAD = 2.0 * pi / 16384


def watch() -> EncoderWatch:
    return EncoderWatch(JUMP_RAD, FASTEST_RAD_S)


def told(encoder: EncoderWatch, messages: Iterator[tuple[float, float]], pushed: bool = False) -> list[tuple[int, str]]:
    """(number of the message, fault) of all that were found."""
    found = []
    for number, (angle_rad, velocity_rad_s) in enumerate(messages):
        state = DriveState(angle_rad=angle_rad, velocity_rad_s=velocity_rad_s, angle_stamp_s=number * PERIOD_S)
        problem = encoder.update(state, TICK_S, pushed)
        if problem:
            found.append((number, problem))
    return found


def frozen(velocity_rad_s: float, messages: int) -> Iterator[tuple[float, float]]:
    return ((0.3, velocity_rad_s) for _ in range(messages))


def test_the_first_message_is_no_jump_wherever_it_is() -> None:
    assert told(watch(), iter([(2.9, 0.0), (2.9, 0.0)])) == []


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_jump_begins_where_no_joint_could_have_gone(sign: float) -> None:
    reach_rad = JUMP_RAD + FASTEST_RAD_S * (PERIOD_S + TICK_S)
    assert told(watch(), iter([(0.0, 0.0), (sign * (reach_rad - 1e-9), 0.0)])) == []
    assert told(watch(), iter([(0.0, 0.0), (sign * (reach_rad + 1e-9), 0.0)])) == [(1, "encoder_jump")]


def test_after_a_gap_a_joint_may_be_farther_away() -> None:
    encoder = watch()
    assert encoder.update(DriveState(angle_rad=0.0, velocity_rad_s=0.0, angle_stamp_s=0.0), TICK_S, False) == ""
    assert encoder.update(DriveState(angle_rad=1.5, velocity_rad_s=0.0, angle_stamp_s=0.05), TICK_S, False) == ""


def test_a_stamp_that_goes_back_is_no_jump_by_itself() -> None:
    encoder = watch()
    encoder.update(DriveState(angle_rad=0.0, velocity_rad_s=0.0, angle_stamp_s=1.0), TICK_S, False)
    assert encoder.update(DriveState(angle_rad=0.01, velocity_rad_s=0.0, angle_stamp_s=0.5), TICK_S, False) == ""


def test_the_same_message_is_judged_once() -> None:
    encoder, state = watch(), DriveState(angle_rad=0.3, velocity_rad_s=9.0, angle_stamp_s=1.0)
    assert {encoder.update(state, TICK_S, True) for _ in range(1000)} == {""}


@pytest.mark.parametrize("velocity_rad_s", [-5.0, -0.5, 0.5, 5.0])
def test_an_angle_that_hangs_is_told_once_the_joint_has_gone_by_its_own_speed(velocity_rad_s: float) -> None:
    found = told(watch(), frozen(velocity_rad_s, 60))
    expected_s = max(GONE_RAD / abs(velocity_rad_s), GONE_S)
    assert {problem for _, problem in found} == {"encoder_stuck"}
    assert found[0][0] * PERIOD_S == pytest.approx(expected_s, abs=1.5 * PERIOD_S)


def test_the_noise_of_a_speed_at_rest_is_no_way() -> None:
    random = Random(1)
    assert told(watch(), ((0.3, random.gauss(0.0, 0.1)) for _ in range(30000))) == []


def test_a_slow_joint_of_few_counts_is_not_stuck() -> None:
    """One count of 16384 takes 0.4 s at 1 mrad/s."""
    for speed_rad_s in (0.001, 0.01, 0.1, 3.0):
        angles = (speed_rad_s * number * PERIOD_S for number in range(3000))
        quantised = ((round(angle / COUNT_RAD) * COUNT_RAD, speed_rad_s) for angle in angles)
        assert told(watch(), quantised) == [], speed_rad_s


def test_a_quick_joint_whose_drive_repeats_itself_now_and_then_is_not_stuck() -> None:
    random, messages, shown = Random(2), [], (0.0, 0.0)
    for number in range(3000):
        phase = 2.0 * pi * number * PERIOD_S
        if random.random() > 0.3:
            shown = (sin(phase), 2.0 * pi * sin(phase + pi / 2.0))
        messages.append(shown)
    assert told(watch(), iter(messages)) == []


def test_a_joint_at_full_torque_that_moves_in_no_bit_is_stuck_after_a_while_and_without_torque_never() -> None:
    messages = int(2.0 * FROZEN_S / PERIOD_S)
    assert told(watch(), frozen(0.0, messages)) == []
    found = told(watch(), frozen(0.0, messages), pushed=True)
    assert found[0][1] == "encoder_stuck"
    assert found[0][0] * PERIOD_S == pytest.approx(FROZEN_S, abs=2.0 * PERIOD_S)


def test_reset_forgets_the_last_message() -> None:
    encoder = watch()
    told(encoder, frozen(0.4, 30))
    encoder.reset()
    assert told(encoder, iter([(-2.0, 0.0)])) == []
