"""Angles that drift away from their speed, and speeds in a wrong range, next to sound joints at any motion."""

from math import cos, floor, pi, sin
from random import Random

import pytest

from control.monitors.encoder_monitor import EncoderMonitor
from control.records import DriveState

MESSAGE_S = 0.00263
COUNT_RAD = 2.0 * pi / 16384
CODE_RAD_S = 130.0 / 4095.0  # of the widest range of CubeMars


def first_fault(
    slip_rad_s: float = 0.0,
    factor: float = 1.0,
    amplitude_rad: float = 0.5,
    noise_rad_s: float = 0.0,
    for_s: float = 20.0,
) -> tuple[str, float]:
    """Return the name of the first fault and its time, for strides of 2 s with codes that are rounded down."""
    encoder, random, now_s = EncoderMonitor("left_sweep", 0.05), Random(1), 0.0
    while now_s < for_s:
        now_s += MESSAGE_S
        angle_rad = amplitude_rad * sin(pi * now_s) + slip_rad_s * now_s
        speed_rad_s = factor * amplitude_rad * pi * cos(pi * now_s) + random.gauss(0.0, noise_rad_s)
        seen = floor(angle_rad / COUNT_RAD) * COUNT_RAD, floor(speed_rad_s / CODE_RAD_S + 0.5) * CODE_RAD_S
        fault = encoder.update(DriveState(*seen, angle_stamp_s=now_s), MESSAGE_S)
        if fault:
            return fault.name, now_s
    return "", now_s


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("rate_rad_s", "within_s"), [(0.05, 3.9), (0.1, 1.7), (0.3, 0.7), (1.0, 0.4)])
@pytest.mark.parametrize("amplitude_rad", [0.001, 0.5])
def test_an_encoder_that_slips_is_found(sign: float, rate_rad_s: float, within_s: float, amplitude_rad: float) -> None:
    name, found_s = first_fault(slip_rad_s=sign * rate_rad_s, amplitude_rad=amplitude_rad)
    assert name in ("encoder_slips", "encoder_stuck") and found_s < within_s


@pytest.mark.parametrize("factor", [50.0 / 25.64, 50.0 / 65.0, 50.0 / 45.0, 1.05, 0.95])
def test_a_speed_in_a_wrong_range_is_found_within_three_strides(factor: float) -> None:
    name, found_s = first_fault(factor=factor)
    assert name == "speed_wrong" or (factor > 1.5 and name == "encoder_slips")  # before the line has a slope
    assert found_s < 6.0


@pytest.mark.parametrize("amplitude_rad", [0.01, 0.05, 0.5, 1.0])
@pytest.mark.parametrize("noise_rad_s", [0.0, 0.3])
def test_a_sound_encoder_is_never_suspected(amplitude_rad: float, noise_rad_s: float) -> None:
    assert first_fault(amplitude_rad=amplitude_rad, noise_rad_s=noise_rad_s, for_s=60.0)[0] == ""


def test_a_speed_that_is_rounded_by_half_a_step_of_its_widest_code_is_no_slip() -> None:
    assert first_fault(slip_rad_s=CODE_RAD_S / 2.0, for_s=60.0)[0] == ""


def test_messages_that_are_held_up_and_come_in_a_burst_are_no_slip() -> None:
    """Every two seconds, at the largest speed, those of 50 ms come within a millisecond."""
    encoder, stamp_s = EncoderMonitor("left_sweep", 0.5), 0.0
    for number in range(round(60.0 / MESSAGE_S)):
        now_s = number * MESSAGE_S
        late_s = max(0.0, 0.05 - now_s % 2.0)
        stamp_s = max(stamp_s + 5e-5, now_s + late_s)
        state = DriveState(sin(pi * now_s), pi * cos(pi * now_s), angle_stamp_s=stamp_s)
        assert encoder.update(state, MESSAGE_S) is None, now_s


@pytest.mark.parametrize("hit_fraction", [0.4, 0.6])
@pytest.mark.parametrize(("slip_rad_s", "name"), [(0.0, ""), (0.4, "encoder_slips"), (-0.4, "encoder_slips")])
def test_a_rotor_that_hits_the_end_of_its_play_is_no_slip(slip_rad_s: float, name: str, hit_fraction: float) -> None:
    """It is thrown for five messages, hits the other end at the same place between two messages, and returns in 34."""
    encoder, names, thrown_rad_s = EncoderMonitor("left_sweep", 0.05), set(), 14.0
    back_rad_s = thrown_rad_s * (2.5 + hit_fraction) / (34.5 - hit_fraction)
    hit_rad_s = thrown_rad_s * hit_fraction - back_rad_s * (1.0 - hit_fraction)  # mean speed of that message
    thrown = [(thrown_rad_s * (k - 0.5) / 5.0, thrown_rad_s * k / 5.0) for k in range(1, 6)]
    cycle = [*thrown, (hit_rad_s, -back_rad_s), *33 * [(-back_rad_s, -back_rad_s)], (-back_rad_s / 2.0, 0.0)]
    angle_rad = 0.0
    for number in range(4000):
        mean_rad_s, speed_rad_s = cycle[number % len(cycle)]
        angle_rad += (mean_rad_s + slip_rad_s) * MESSAGE_S
        fault = encoder.update(DriveState(angle_rad, speed_rad_s, number * MESSAGE_S), MESSAGE_S)
        names |= {fault.name} if fault else set()
    assert names == ({name} if name else set())
