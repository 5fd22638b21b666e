"""Moments of torque and motion show a wrong gain only where the torque varied and the motion follows it."""

import pytest

from control.joint_friction import NO_FRICTION
from control.monitors.torque_gain_monitor import BLOCK_TICKS, FACTOR_OF_ONE, SAME_IN_SWING, JointStrokes, Moments
from control.rate import PERIOD_S
from control.records import DriveState

INERTIA_KG_M2 = 0.0004


def stride_of(speeds_rad_s: list[float], torques_nm: list[float]) -> Moments:
    """Return the sums of a stroke: torques of blocks, and the speeds between them."""
    strokes = JointStrokes("left_sweep", INERTIA_KG_M2, NO_FRICTION, SAME_IN_SWING)
    states = [DriveState(0.0, each, 1.0 + n * BLOCK_TICKS * PERIOD_S) for n, each in enumerate(speeds_rad_s)]
    for before, after, torque_nm in zip(states, states[1:], torques_nm, strict=False):
        strokes.add(before, after, torque_nm, 0.0)
    strokes.end_stroke()
    return strokes.end_stride()


@pytest.mark.parametrize("uu", [0.0, -1e-17, 1e-17])
def test_a_torque_that_stays_at_its_limit_shows_no_gain(uu: float) -> None:
    """A joint that lies at its stop: the sums about the mean are the rounding of floats, of either sign."""
    assert Moments(blocks=9, uu=uu, um=1e-17, mm=0.1).gain_beyond(FACTOR_OF_ONE) is None
    assert Moments(blocks=9, uu=uu, um=1e-17, mm=1e-18).gain_beyond(FACTOR_OF_ONE) is None


def test_a_motion_whose_square_underflows_raises_nothing() -> None:
    assert Moments(blocks=9, uu=1e-6, um=1e-170, mm=1e-320).gain_beyond(FACTOR_OF_ONE) == pytest.approx(0.0)


@pytest.mark.parametrize("gain", [0.3, 3.0])
def test_a_wrong_gain_is_returned(gain: float) -> None:
    assert Moments(9, 0.1, gain * 0.1, gain * gain * 0.1).gain_beyond(FACTOR_OF_ONE) == pytest.approx(gain)


def test_a_joint_that_the_mud_lets_go_of_shows_no_gain_while_it_is_faster_than_any_path() -> None:
    """Measured in a simulated walk with play in its belts: the rotor turns alone while the torque rises."""
    fast = stride_of([-22.31, -13.98, -2.12, 1.4, 1.4, 1.4, 1.4, 1.4, 1.4, 1.4], [0.1627, 0.5278, 0.3643, *[0.0] * 6])
    assert fast.gain_beyond(FACTOR_OF_ONE) is None


@pytest.mark.parametrize(("scatter", "names"), [(0.3, {"torque_gain"}), (0.71, set())])
def test_a_sweep_whose_motion_scatters_as_that_of_a_rotor_in_its_play_shows_no_gain(
    scatter: float, names: set[str]
) -> None:
    """The motion of a rotor in its play: 0.71 of the regression's slope is r² = 0.67, as in a simulated walk."""
    strokes = JointStrokes("left_sweep", INERTIA_KG_M2, NO_FRICTION, SAME_IN_SWING)
    gain = 1.7
    stride = Moments(blocks=74, uu=7e-4, um=gain * 7e-4, mm=gain * gain * 7e-4 * (1.0 + scatter * scatter))
    faults = [strokes.fault_of(stride) for _ in range(3)]
    assert {fault.name for fault in faults if fault} == names
