"""The offset of another computer's clock, and the position of a body between two frames."""

from math import isnan, sin
from random import Random

import pytest

from drivers.pose.pose_timing import JUMP_M, RESTARTED_S, LeastDelay, PoseForecast

PERIOD_S = 1.0 / 120.0


def test_the_least_delay_gives_the_offset_of_the_clocks() -> None:
    """The delays are 1 ms and more, and the clock lags by 50 s and runs slow by 50 ppm."""
    chance, delay = Random(2), LeastDelay()
    for frame in range(120 * 60):
        now_s = frame * PERIOD_S
        sent_s = now_s * (1.0 - 50e-6) - 50.0
        reported_s = sent_s + delay.update(now_s + 0.001 + chance.expovariate(1.0 / 0.004), sent_s)
        if now_s > 1.0:
            assert -0.0015 < reported_s - (now_s + 0.001) < 0.001


def test_a_clock_that_was_set_is_noticed_in_both_directions() -> None:
    delay = LeastDelay()
    assert delay.update(10.0, 3.0) == 7.0
    assert delay.update(11.0, 4.0 - 2.0 * RESTARTED_S) == 7.0 + 2.0 * RESTARTED_S
    assert delay.update(12.0, 8.0) == 4.0
    assert delay.update(13.0, 8.5) == 4.0  # a delayed message


def test_a_body_continues_at_its_speed() -> None:
    forecast = PoseForecast()
    assert isnan(forecast.at(0.0))
    for frame in range(10):
        forecast.add(frame * PERIOD_S, 0.3 * frame * PERIOD_S)
    last_s = 9 * PERIOD_S
    assert forecast.at(last_s) == pytest.approx(0.3 * last_s)
    assert forecast.at(last_s + 0.02) == pytest.approx(0.3 * (last_s + 0.02))
    assert forecast.at(last_s + 10.0) < 0.3 * last_s + 0.05  # but not for ever


def test_an_extrapolated_position_is_closer_than_the_last_one() -> None:
    """The motion is a step of the walk, as a sine, seen 10 ms late."""
    forecast, missed_m, old_m = PoseForecast(), 0.0, 0.0
    for frame in range(240):
        stamp_s = frame * PERIOD_S
        position_m = 0.06 * sin(6.0 * stamp_s)
        forecast.add(stamp_s, position_m)
        true_m = 0.06 * sin(6.0 * (stamp_s + 0.01))
        if frame > 3:
            missed_m, old_m = (
                max(missed_m, abs(forecast.at(stamp_s + 0.01) - true_m)),
                max(old_m, abs(position_m - true_m)),
            )
    assert missed_m < 0.15 * old_m


def test_nothing_is_forecast_of_a_body_that_leapt_or_went_back_in_time() -> None:
    forecast = PoseForecast()
    assert not forecast.add(1.0, 0.0)
    assert forecast.add(1.0 + PERIOD_S, 0.004) and forecast.add(1.0 + 2.0 * PERIOD_S, 0.008)
    assert not forecast.add(1.0 + 3.0 * PERIOD_S, 0.010 + 2.0 * JUMP_M)
    assert forecast.at(1.0 + 4.0 * PERIOD_S) == 0.010 + 2.0 * JUMP_M
    assert not forecast.add(0.5, 0.1)
    assert forecast.at(0.51) == 0.1
