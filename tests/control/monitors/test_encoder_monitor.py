"""Encoders that jump or stand still, distinguished from joints that are fast, at rest, or held by the mud."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import cos, pi, sin
from random import Random

import pytest

from control.monitors.encoder_monitor import FROZEN_S, MOVED_RAD, MOVED_S, UNCHANGED_S, YIELDING_NM, EncoderMonitor
from control.rate import PERIOD_S
from control.records import DriveState

MESSAGE_S = 0.002
JUMP_RAD = 0.05
COUNT_RAD = 2.0 * pi / 16384
Messages = Iterable[tuple[float, float]]


def reported(messages: Messages, encoder: EncoderMonitor | None = None) -> list[tuple[int, str]]:
    """Return (number of the message, fault) of every fault."""
    encoder, found = encoder or EncoderMonitor("left_sweep", JUMP_RAD), []
    for number, (angle_rad, velocity_rad_s) in enumerate(messages):
        state = DriveState(angle_rad=angle_rad, velocity_rad_s=velocity_rad_s, angle_stamp_s=number * MESSAGE_S)
        fault = encoder.update(state, PERIOD_S)
        if fault:
            found.append((number, fault.name))
    return found


def hanging(velocity_rad_s: float, messages: int) -> Iterator[tuple[float, float]]:
    return ((0.3, velocity_rad_s) for _ in range(messages))


def test_the_first_message_is_no_jump_wherever_it_is() -> None:
    assert reported([(2.9, 0.0), (2.9, 0.0)]) == []


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("velocity_rad_s", [0.0, 5.0, -16.0])
def test_a_jump_begins_beyond_what_the_drives_own_speed_explains(sign: float, velocity_rad_s: float) -> None:
    path_rad, slack_rad = velocity_rad_s * MESSAGE_S, JUMP_RAD + abs(velocity_rad_s) * PERIOD_S
    for beyond_rad, expected in ((-1e-9, []), (1e-9, [(1, "encoder_jump")])):
        step_rad = path_rad + sign * (slack_rad + beyond_rad)
        assert reported([(0.0, velocity_rad_s), (step_rad, velocity_rad_s)]) == expected


def test_a_magnet_that_slips_at_rest_is_reported() -> None:
    assert reported([(0.1, 0.0)] * 5 + [(0.2, 0.0)] * 5) == [(5, "encoder_jump")]


def test_readings_that_jump_about_a_joint_at_rest_are_reported_repeatedly() -> None:
    random = Random(3)
    found = reported((random.uniform(-0.1, 0.1), 0.0) for _ in range(200))
    assert len(found) > 50


@pytest.mark.parametrize(("gap_s", "expected"), [(0.029, "encoder_jump"), (0.031, None)])
def test_after_a_long_gap_a_joint_may_be_anywhere(gap_s: float, expected: str | None) -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    assert encoder.update(DriveState(angle_rad=0.0, velocity_rad_s=0.0, angle_stamp_s=0.0), PERIOD_S) is None
    fault = encoder.update(DriveState(angle_rad=0.75, velocity_rad_s=0.0, angle_stamp_s=gap_s), PERIOD_S)
    assert (fault and fault.name) == expected


def test_after_a_short_gap_a_joint_may_be_where_its_speed_took_it() -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    assert encoder.update(DriveState(angle_rad=0.0, velocity_rad_s=15.0, angle_stamp_s=0.0), PERIOD_S) is None
    assert encoder.update(DriveState(angle_rad=0.3, velocity_rad_s=15.0, angle_stamp_s=0.02), PERIOD_S) is None


def test_a_stamp_that_goes_back_is_no_jump_by_itself() -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    encoder.update(DriveState(angle_rad=0.0, velocity_rad_s=0.0, angle_stamp_s=1.0), PERIOD_S)
    assert encoder.update(DriveState(angle_rad=0.01, velocity_rad_s=0.0, angle_stamp_s=0.5), PERIOD_S) is None


def test_the_same_message_is_evaluated_once() -> None:
    encoder, state = (
        EncoderMonitor("left_sweep", JUMP_RAD),
        DriveState(angle_rad=0.3, velocity_rad_s=9.0, angle_stamp_s=1.0),
    )
    assert {encoder.update(state, PERIOD_S) for _ in range(1000)} == {None}


@pytest.mark.parametrize("velocity_rad_s", [-5.0, -0.5, -1e-3, 1e-6, 0.5, 5.0])
def test_a_frozen_angle_shows_in_the_integral_of_the_velocity_or_in_a_velocity_without_noise(
    velocity_rad_s: float,
) -> None:
    found = reported(hanging(velocity_rad_s, 60))
    expected_s = min(max(MOVED_RAD / abs(velocity_rad_s), MOVED_S), FROZEN_S)
    assert {problem for _, problem in found} == {"encoder_stuck"}
    assert found[0][0] * MESSAGE_S == pytest.approx(expected_s, abs=1.5 * MESSAGE_S)


@pytest.mark.parametrize(("gap_s", "expected"), [(0.029, ["encoder_stuck"]), (0.031, [])])
def test_a_code_that_comes_again_after_a_long_gap_is_not_stuck(gap_s: float, expected: list[str]) -> None:
    """In 31 ms a joint that rocks in the mud comes back to an angle at which it was."""
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    states = [DriveState(angle_rad=0.3, velocity_rad_s=2.0, angle_stamp_s=stamp_s) for stamp_s in (1.0, 1.0 + gap_s)]
    faults = [encoder.update(state, PERIOD_S) for state in states]
    assert [fault.name for fault in faults if fault] == expected


def test_an_angle_that_stays_frozen_after_a_long_gap_is_stuck() -> None:
    encoder, found = EncoderMonitor("left_sweep", JUMP_RAD), []
    for number in range(30):
        stamp_s = number * MESSAGE_S + (0.1 if number >= 5 else 0.0)
        found.append(encoder.update(DriveState(angle_rad=0.3, velocity_rad_s=2.0, angle_stamp_s=stamp_s), PERIOD_S))
    assert not any(found[:10]) and found[-1] and found[-1].name == "encoder_stuck"


def test_a_joint_at_rest_without_a_velocity_is_not_stuck() -> None:
    """An ODrive reports 0 below a threshold."""
    assert reported(hanging(0.0, 30000)) == []


def test_a_speed_that_has_died_away_to_its_last_bit_is_rest() -> None:
    assert reported(hanging(2.4e-17, 1000)) == []


def test_the_noise_of_a_velocity_at_rest_is_no_travel() -> None:
    random = Random(1)
    assert reported((0.3, random.gauss(0.0, 0.1)) for _ in range(30000)) == []


def test_a_slow_joint_of_few_counts_is_not_stuck() -> None:
    """One count of 16384 takes 0.4 s at 1 mrad/s."""
    random = Random(4)
    for speed_rad_s in (0.001, 0.01, 0.1, 3.0):
        angles = (speed_rad_s * number * MESSAGE_S for number in range(3000))
        messages = ((round(a / COUNT_RAD) * COUNT_RAD, speed_rad_s + random.gauss(0.0, 1e-4)) for a in angles)
        assert reported(messages) == [], speed_rad_s


def test_a_quick_joint_whose_drive_repeats_itself_now_and_then_is_not_stuck() -> None:
    random, messages, shown = Random(2), [], (0.0, 2.0 * pi)
    for number in range(3000):
        phase = 2.0 * pi * number * MESSAGE_S
        if random.random() > 0.3:
            shown = (sin(phase), 2.0 * pi * cos(phase))
        messages.append(shown)
    assert reported(messages) == []


def test_reset_forgets_the_last_message() -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    reported(hanging(0.4, 30), encoder)
    encoder.reset()
    assert reported([(-2.0, 0.0)], encoder) == []


def unchanged(torques_nm: list[float], velocity_rad_s: float = 0.0, turning: bool = False) -> int | None:
    """Return the tick of the fault of an encoder whose messages repeat while these torques are commanded."""
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    for tick, torque_nm in enumerate(torques_nm):
        angle_rad = 0.1 + turning * 1e-6 * tick
        state = DriveState(angle_rad=angle_rad, velocity_rad_s=velocity_rad_s, angle_stamp_s=tick * PERIOD_S)
        if encoder.update(state, PERIOD_S, torque_nm):
            return tick
    return None


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_encoder_at_exactly_zero_speed_is_stuck_when_the_torque_changes(sign: float) -> None:
    ramp = [sign * 0.01 * tick for tick in range(100)]
    tick = unchanged(ramp)
    assert tick is not None and max(UNCHANGED_S / PERIOD_S, YIELDING_NM / 0.01) <= tick <= 47
    assert unchanged(ramp, turning=True) is None


def test_a_constant_torque_and_one_that_dry_friction_holds_leave_a_joint_at_rest() -> None:
    assert unchanged([0.7] * 1000) is None
    assert unchanged([0.06, -0.06] * 500) is None
    assert unchanged([0.0] * 2 + [YIELDING_NM + 1e-6] * 30) == pytest.approx(UNCHANGED_S / PERIOD_S, abs=1.1)
