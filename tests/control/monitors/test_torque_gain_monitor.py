"""Moments of torque and motion show a wrong gain only where the torque varied."""

import pytest

from control.monitors.torque_gain_monitor import FACTOR_OF_ONE, Moments


@pytest.mark.parametrize("uu", [0.0, -1e-17, 1e-17])
def test_a_torque_that_stays_at_its_limit_shows_no_gain(uu: float) -> None:
    """A joint that lies at its stop: the sums about the mean are the rounding of floats, of either sign."""
    assert Moments(blocks=9, uu=uu, um=1e-17, mm=0.1).gain_beyond(FACTOR_OF_ONE) is None
    assert Moments(blocks=9, uu=uu, um=1e-17, mm=1e-18).gain_beyond(FACTOR_OF_ONE) is None


@pytest.mark.parametrize("gain", [0.3, 3.0])
def test_a_wrong_gain_is_returned(gain: float) -> None:
    assert Moments(9, 0.1, gain * 0.1, gain * gain * 0.1).gain_beyond(FACTOR_OF_ONE) == pytest.approx(gain)
