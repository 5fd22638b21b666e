"""`apply_limits` swept densely over the edge of each of its bounds, and with any input that hypothesis finds."""

from math import inf, isfinite, nan, nextafter, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.limits import JointRange, LimitedTorques, apply_limits, limited_torque_nm
from control.parameters.joint_limits import JointLimits
from control.rate import PERIOD_S
from control.records import DriveState, DriveStates, Joints, Torques, same_for_all
from tests.control.synthetic_states import NO_TORQUE

LIMITS = JointLimits()
SLEW_NM = LIMITS.torque_rate_nm_s * PERIOD_S
SPAN = JointRange(radians(-60.0), radians(60.0))
RANGES = same_for_all(SPAN)
ROUNDING = 1e-12

torques = st.floats(-2.0, 2.0)
previous_torques = st.floats(-LIMITS.torque_nm, LIMITS.torque_nm)
states = st.builds(
    DriveState,
    angle_rad=st.floats(-2.0, 2.0),
    velocity_rad_s=st.floats(-20.0, 20.0),
    temperature_c=st.floats(0.0, 120.0) | st.just(nan),
)
finite_limits = st.builds(
    JointLimits,
    torque_nm=st.floats(0.0, 5.0),
    torque_rate_nm_s=st.floats(1.0, 10000.0),
    velocity_rad_s=st.floats(0.1, 200.0),
)


def four_torques(each: st.SearchStrategy[float]) -> st.SearchStrategy[Torques]:
    return st.builds(Joints, each, each, each, each)


def state(angle_rad: float = 0.0, velocity_rad_s: float = 0.0, temperature_c: float = 25.0) -> DriveState:
    return DriveState(angle_rad=angle_rad, velocity_rad_s=velocity_rad_s, temperature_c=temperature_c)


STILL: DriveStates = Joints(state(), state(), state(), state())


def settled_nm(wanted_nm: float, joint: DriveState) -> float:
    """Return what is left of a wanted torque when the slew rate does not bind."""
    return limited_torque_nm(wanted_nm, 0.0, joint, LIMITS, SPAN, dt_s=1.0)


def limited_like(joint: int, wanted_nm: float, measured: DriveState) -> LimitedTorques:
    """Limit the torques of joints at rest, of which only one wants a torque."""
    wanted, drives = list(NO_TORQUE), list(STILL)
    wanted[joint], drives[joint] = wanted_nm, measured
    return apply_limits(Joints(*wanted), NO_TORQUE, Joints(*drives), LIMITS, RANGES, PERIOD_S)


# torque


def test_the_torque_limit_cuts_exactly_at_its_bound() -> None:
    for wanted in np.linspace(-1.5, 1.5, 3001):
        assert settled_nm(float(wanted), state()) == min(max(wanted, -0.75), 0.75)
    assert settled_nm(nextafter(0.75, 0.0), state()) == nextafter(0.75, 0.0)
    assert settled_nm(nextafter(0.75, 1.0), state()) == 0.75
    assert settled_nm(nextafter(-0.75, -1.0), state()) == -0.75


@given(finite_limits, st.floats(allow_nan=False), st.floats(-1.0, 1.0), states, st.floats(0.0, 0.1))
def test_limits_let_out_no_more_than_the_torque_limit_and_no_more_than_the_slew_rate(
    limits: JointLimits, wanted: float, fraction: float, joint: DriveState, dt: float
) -> None:
    previous = fraction * limits.torque_nm
    torque = limited_torque_nm(wanted, previous, joint, limits, SPAN, dt)
    assert abs(torque) <= limits.torque_nm * (1.0 + ROUNDING)
    assert abs(torque - previous) <= limits.torque_rate_nm_s * dt * (1.0 + ROUNDING) + 1e-15 * limits.torque_nm


# slew rate


def test_the_slew_rate_binds_exactly_one_step_from_the_previous_torque() -> None:
    for previous in np.linspace(-0.75, 0.75, 61):
        for change in np.linspace(-2.0 * SLEW_NM, 2.0 * SLEW_NM, 81):
            wanted = float(min(max(previous + change, -0.75), 0.75))
            torque = limited_torque_nm(wanted, float(previous), state(), LIMITS, SPAN, PERIOD_S)
            expected = min(max(wanted, previous - SLEW_NM), previous + SLEW_NM)
            assert torque == pytest.approx(expected, abs=ROUNDING)


# position


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_no_torque_pushes_outward_from_the_end_of_the_range_on(side: float) -> None:
    edge = SPAN.max_rad
    for beyond in [0.0, 5e-324, 1e-15, *np.linspace(1e-9, 0.5, 200)]:
        outside = state(side * (edge + beyond))
        assert settled_nm(side * 0.5, outside) == 0.0
        assert settled_nm(-side * 0.5, outside) == -side * 0.5
    for inside in [nextafter(edge, 0.0), *np.linspace(edge - 1e-9, -edge + 1e-9, 200)]:
        assert settled_nm(side * 0.5, state(side * inside)) == side * 0.5


@given(previous_torques, st.floats(-10.0, 10.0), st.floats(0.0, 1.0), st.sampled_from([1.0, -1.0]))
def test_beyond_the_range_outward_torque_only_shrinks_and_is_gone_within_the_slew_time(
    previous: float, wanted: float, beyond: float, side: float
) -> None:
    outside, torque = state(side * (SPAN.max_rad + beyond)), previous
    for _ in range(3):
        later = limited_torque_nm(wanted, torque, outside, LIMITS, SPAN, PERIOD_S)
        assert side * later <= max(0.0, side * torque - SLEW_NM + ROUNDING)
        torque = later
    assert side * torque <= 0.0


def test_each_joint_has_its_own_range() -> None:
    ranges = Joints(JointRange(-1.0, 1.0), JointRange(-2.0, 2.0), JointRange(-3.0, 3.0), JointRange(-4.0, 4.0))
    pushed = same_for_all(0.1)
    for joint, angle in enumerate((0.5, 1.5, 2.5, 3.5)):
        here = state(angle)
        sent = apply_limits(pushed, pushed, Joints(here, here, here, here), LIMITS, ranges, 1.0).torques_nm
        assert sent == tuple(0.0 if other < joint else 0.1 for other in range(4))


# velocity


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_torque_that_speeds_a_joint_up_fades_out_over_the_last_fifth_of_the_velocity_limit(side: float) -> None:
    fade_start = 0.8 * LIMITS.velocity_rad_s
    for velocity in np.linspace(0.0, 20.0, 4001):
        fraction = np.interp(velocity, [fade_start, LIMITS.velocity_rad_s], [1.0, 0.0])
        moving = state(velocity_rad_s=side * float(velocity))
        assert settled_nm(side * 9.0, moving) == pytest.approx(side * 0.75 * fraction, abs=1e-12)
        assert settled_nm(-side * 9.0, moving) == -side * 0.75


def test_a_small_torque_is_not_scaled_but_capped_by_the_velocity_fade_which_has_no_step_at_its_ends() -> None:
    halfway = state(velocity_rad_s=0.9 * LIMITS.velocity_rad_s)
    assert settled_nm(0.3, halfway) == 0.3
    assert settled_nm(0.5, halfway) == pytest.approx(0.375)
    for edge in (0.8 * LIMITS.velocity_rad_s, LIMITS.velocity_rad_s):
        below, above = (settled_nm(9.0, state(velocity_rad_s=nextafter(edge, to))) for to in (0.0, inf))
        assert below == pytest.approx(above, abs=1e-12)
        assert above >= 0.0


# temperature


def test_torque_derates_from_warm_to_nothing_when_hot() -> None:
    for temperature in np.linspace(0.0, 150.0, 3001):
        fraction = np.interp(temperature, [70.0, 90.0], [1.0, 0.0])
        warm = state(temperature_c=float(temperature))
        for side in (1.0, -1.0):
            assert settled_nm(side * 9.0, warm) == pytest.approx(side * 0.75 * fraction, abs=1e-12)


@pytest.mark.parametrize(
    ("warm_c", "hot_c", "temperature_c", "torque_nm"),
    [
        (70.0, 90.0, 70.0, 0.75),
        (70.0, 90.0, 90.0, 0.0),
        (70.0, 90.0, nextafter(90.0, 0.0), 5.33e-16),
        (70.0, 90.0, inf, 0.0),
        (70.0, 90.0, nan, 0.75),  # a drive without thermistor counts as cool
        (80.0, 80.0, nextafter(80.0, 0.0), 0.75),  # both at one temperature: it switches off at it
        (80.0, 80.0, 80.0, 0.0),
        (80.0, 80.0, 81.0, 0.0),
        (80.0, 80.5, 80.25, 0.375),  # less than a kelvin apart: it derates between them
    ],
)
def test_torque_is_nothing_from_hot_on_and_whole_up_to_warm(
    warm_c: float, hot_c: float, temperature_c: float, torque_nm: float
) -> None:
    limits = JointLimits(temperature_warm_c=warm_c, temperature_hot_c=hot_c)
    limited_nm = limited_torque_nm(9.0, 0.0, state(temperature_c=temperature_c), limits, SPAN, 1.0)
    assert limited_nm == pytest.approx(torque_nm, rel=0.01, abs=0.0)


# not finite


@pytest.mark.parametrize("joint", range(4))
@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_one_torque_or_measurement_that_is_not_finite_turns_all_four_to_zero(joint: int, bad: float) -> None:
    for wanted_nm, measured in ((bad, state()), (0.1, state(angle_rad=bad)), (0.1, state(velocity_rad_s=bad))):
        assert limited_like(joint, wanted_nm, measured) == LimitedTorques(NO_TORQUE, True, False)


any_float = st.floats(-1e300, 1e300) | st.sampled_from((nan, inf, -inf))  # the sum of three larger ones is infinite


@given(
    four_torques(any_float),
    four_torques(previous_torques),
    st.builds(Joints, *[st.builds(DriveState, any_float, any_float, temperature_c=st.floats())] * 4),
    st.floats(0.0, 1.0),
)
def test_the_limited_torques_are_always_finite_and_flag_a_replaced_input(
    wanted: Torques, previous: Torques, measured: DriveStates, dt: float
) -> None:
    sent = apply_limits(wanted, previous, measured, LIMITS, RANGES, dt)
    known = [*wanted, *(value for joint in measured for value in (joint.angle_rad, joint.velocity_rad_s))]
    assert sent.finite == all(isfinite(value) for value in known)
    assert all(isfinite(torque) for torque in sent.torques_nm)
    assert sent.finite or sent.torques_nm == NO_TORQUE


# the flag


@given(four_torques(torques), four_torques(previous_torques), st.builds(Joints, states, states, states, states))
def test_limited_is_reported_exactly_when_something_changed(
    wanted: Torques, previous: Torques, measured: DriveStates
) -> None:
    sent = apply_limits(wanted, previous, measured, LIMITS, RANGES, PERIOD_S)
    assert sent.limited == (sent.torques_nm != wanted)


@given(four_torques(st.floats(-0.75, 0.75)), four_torques(st.floats(-1.0, 1.0)))
def test_a_torque_within_every_bound_passes_unchanged(wanted: Torques, fractions: Torques) -> None:
    a, b, c, d = (torque + 0.99 * fraction * SLEW_NM for torque, fraction in zip(wanted, fractions, strict=True))
    sent = apply_limits(wanted, Joints(a, b, c, d), STILL, LIMITS, RANGES, PERIOD_S)
    assert sent == LimitedTorques(wanted, False, True)
