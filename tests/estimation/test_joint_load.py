"""Joint loads from currents: the balance of torques on an arm that is simulated here, and which samples count as
new.
"""

from math import cos, inf, isfinite, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.geometry import FlipperGeometry
from control.joint_friction import JointFriction
from control.parameters.arm_mass import ArmMass
from control.rate import PERIOD_S
from control.records import DriveState
from estimation.joint_load import (
    CLINGING_M,
    LONGEST_GAP_S,
    NO_COMMANDS,
    SATURATION,
    CommandTimes,
    FlipperDrive,
    JointLoad,
    JointLoads,
    motion_at,
    motion_between,
)

GEOMETRY, MASS = FlipperGeometry(), ArmMass()
SWEEP_NM_A, LIFT_NM_A = 0.083, 0.09
WEIGHTLESS = ArmMass(0.0, 0.0, 0.0, 0.0)
DRIVE = FlipperDrive(MASS, SWEEP_NM_A, LIFT_NM_A)

angles = st.floats(-pi / 3, pi / 3)
currents = st.floats(-20.0, 20.0)


def sample(angle_rad: float, velocity_rad_s: float, current_a: float, now_s: float) -> DriveState:
    return DriveState(angle_rad, velocity_rad_s, now_s, current_a, now_s)


def one(drive: FlipperDrive, sweep: DriveState, adduction: DriveState) -> JointLoad:
    load = JointLoads(GEOMETRY, drive).update(sweep, adduction)
    assert load is not None
    return load


# one sample


@given(angles, angles, currents, currents)
def test_without_mass_the_load_is_the_papers(sweep: float, lift: float, sweep_a: float, lift_a: float) -> None:
    drive = FlipperDrive(WEIGHTLESS, SWEEP_NM_A, LIFT_NM_A)
    load = one(drive, sample(sweep, nan, sweep_a, 1.0), sample(lift, nan, lift_a, 1.0))
    assert load.sweep_nm == pytest.approx(-SWEEP_NM_A * sweep_a, abs=1e-15)
    assert load.adduction_nm == pytest.approx(-LIFT_NM_A * lift_a, abs=1e-15)


@given(angles, angles)
def test_the_torque_that_holds_the_arm_in_the_air_is_no_load(sweep: float, lift: float) -> None:
    gravity_nm = MASS.gravity_torques_nm(sweep, lift)
    held = (sample(sweep, 0.0, -gravity_nm[0] / SWEEP_NM_A, 1.0), sample(lift, 0.0, -gravity_nm[1] / LIFT_NM_A, 1.0))
    load = one(DRIVE, *held)
    assert (load.sweep_nm, load.adduction_nm) == pytest.approx((0.0, 0.0), abs=1e-15)


@given(angles, angles)
def test_the_pose_comes_with_its_depth_and_levers(sweep: float, lift: float) -> None:
    load = one(DRIVE, sample(sweep, 0.0, 0.0, 1.0), sample(lift, 0.0, 0.0, 1.0))
    jacobian = GEOMETRY.jacobian(sweep, lift)
    assert (load.sweep_rad, load.adduction_rad) == (sweep, lift)
    assert load.depth_m == pytest.approx(GEOMETRY.depth_m(sweep, lift), abs=1e-15)
    assert load.rise_sweep_m == pytest.approx(jacobian.z_sweep, abs=1e-15)
    assert load.rise_clinging_m + CLINGING_M * sin(lift) == pytest.approx(jacobian.z_adduction, abs=1e-15)


def test_friction_is_what_the_motor_spends_on_itself_and_that_of_an_unknown_velocity_is_cogging_alone() -> None:
    friction = JointFriction(coulomb_nm=0.02, viscous_nm_s=0.004, cogging_nm=0.01, cogging_per_turn=1)
    drive = FlipperDrive(WEIGHTLESS, SWEEP_NM_A, LIFT_NM_A, friction, friction)
    spent_nm = [friction.torque_nm(0.5, 2.0), friction.torque_nm(-0.5, -2.0)]
    free = one(drive, sample(0.5, 2.0, spent_nm[0] / SWEEP_NM_A, 1.0), sample(-0.5, -2.0, spent_nm[1] / LIFT_NM_A, 1.0))
    assert (free.sweep_nm, free.adduction_nm) == pytest.approx((0.0, 0.0), abs=1e-15)
    unknown = one(drive, sample(0.5, nan, 0.0, 1.0), sample(-0.5, inf, 0.0, 1.0))
    assert (unknown.sweep_nm, unknown.adduction_nm) == pytest.approx((0.01 * sin(0.5), -0.01 * sin(0.5)))


@pytest.mark.parametrize(
    ("sweep_a", "lift_a", "saturated"),
    [
        (9.7, 0.0, False),
        (9.81, 0.0, True),
        (-9.81, 0.0, True),
        (0.0, -10.0, False),
    ],
)
def test_a_sweep_motor_at_its_limit_is_reported(sweep_a: float, lift_a: float, saturated: bool) -> None:
    """Clipped currents fluctuate a little below the limit."""
    assert SATURATION == 0.98
    limited = DRIVE._replace(current_limit_a=10.0)
    assert one(limited, sample(0.0, 0.0, sweep_a, 1.0), sample(0.0, 0.0, lift_a, 1.0)).saturated is saturated


# inertia


def swinging(now_s: float, rate_rad_s: float, amplitude_rad: float) -> tuple[float, float, float]:
    """Return the angle, velocity and acceleration."""
    phase = rate_rad_s * now_s
    return (
        amplitude_rad * sin(phase),
        amplitude_rad * rate_rad_s * cos(phase),
        -amplitude_rad * rate_rad_s**2 * sin(phase),
    )


def loads_of_a_free_arm(angle_every_s: float, current_every_s: float, shift_s: float) -> list[JointLoad]:
    """Return the loads of joints that swing in the air as fast as an extraction; angle and current come in separate
    messages.
    """

    def joint(now_s: float, constant_nm_a: float, inertia_kg_m2: float, index: int) -> DriveState:
        angle_s = now_s - now_s % angle_every_s
        current_s = now_s - (now_s - shift_s) % current_every_s
        poses = [[swinging(at_s, 20.0, 0.3), swinging(at_s + 0.02, 25.0, 0.2)] for at_s in (angle_s, current_s)]
        angle_rad, velocity_rad_s, _ = poses[0][index]
        gravity_nm = MASS.gravity_torques_nm(poses[1][0][0], poses[1][1][0])[index]
        current_a = (inertia_kg_m2 * poses[1][index][2] - gravity_nm) / constant_nm_a
        return DriveState(angle_rad, velocity_rad_s, angle_s, current_a, current_s)

    loads, seen = JointLoads(GEOMETRY, DRIVE), list[JointLoad]()
    for tick in range(200):
        now_s = 1.0 + tick * PERIOD_S
        sweep = joint(now_s, SWEEP_NM_A, MASS.sweep_inertia_kg_m2, 0)
        adduction = joint(now_s, LIFT_NM_A, MASS.adduction_inertia_kg_m2, 1)
        load = loads.update(sweep, adduction)
        if load is not None and tick > 5:
            seen.append(load)
    return seen


INERTIA_NM = MASS.adduction_inertia_kg_m2 * 0.2 * 25.0**2


@pytest.mark.parametrize(
    ("ticks", "shift_s", "fraction"),
    [
        (1, 0.0, 0.002),  # lines instead of curves leave (ω dt)²/8 of the 0.08 N·m that the inertia takes
        *((1, shift_s, 0.01) for shift_s in (0.0005, 0.001, 0.0015)),  # uninterpolated, half a tick leaves 3 %
        *((ticks, 0.0005, 0.02) for ticks in (2, 4)),  # without a new angle the last acceleration counts
    ],
)
def test_a_free_arm_in_quick_motion_withstands_no_load(ticks: int, shift_s: float, fraction: float) -> None:
    loads = loads_of_a_free_arm(ticks * PERIOD_S, PERIOD_S, shift_s)
    assert len(loads) > 100
    assert max(max(abs(load.sweep_nm), abs(load.adduction_nm)) for load in loads) < fraction * INERTIA_NM


def test_a_joint_whose_message_is_late_does_not_lose_its_inertia() -> None:
    """Only the other joint is new."""
    loads = JointLoads(GEOMETRY, DRIVE)
    loads.update(sample(0.1, 1.0, 0.0, 1.0), sample(0.0, 0.0, 0.0, 1.0))
    plain = loads.update(sample(0.1, 1.0, 1.0, 1.01), sample(0.0, 2.0, 0.0, 1.01))
    late = loads.update(sample(0.1, 1.0, 2.0, 1.02), sample(0.0, 2.0, 0.0, 1.01))
    assert plain is not None
    assert late is not None
    assert late.adduction_nm == plain.adduction_nm != 0.0


@given(angles, angles, st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), currents, currents)
def test_between_two_samples_everything_is_half_way(
    angle: float, later: float, velocity: float, after: float, current: float, current_after: float
) -> None:
    motion = motion_between(sample(angle, velocity, current, 1.0), sample(later, after, current_after, 1.01))
    middle = (
        (angle + later) / 2.0,
        (velocity + after) / 2.0,
        (after - velocity) / 0.01,
        (current + current_after) / 2.0,
    )
    assert motion == pytest.approx(middle, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("gap_s", [LONGEST_GAP_S, 1.0, 0.0, -0.01, nan, inf])
def test_samples_that_are_not_of_one_motion_are_used_unchanged(gap_s: float) -> None:
    motion = motion_between(sample(0.1, 1.0, 2.0, 1.0), sample(0.3, 3.0, 4.0, 1.0 + gap_s))
    assert motion == (0.3, 3.0, 0.0, 4.0)
    assert gap_s or motion_at(sample(0.1, 1.0, 2.0, 1.0), sample(0.3, 3.0, 4.0, 1.0)) == motion


@pytest.mark.parametrize(
    ("stamps_s", "commands_s", "current_a"),
    [
        ((1.000, 1.010), NO_COMMANDS, 3.0),  # at the times of the angles: half-way
        ((1.005, 1.015), NO_COMMANDS, 2.0),  # the earlier current is of that very time
        ((0.995, 1.005), NO_COMMANDS, 4.0),
        ((0.990, 1.000), NO_COMMANDS, 5.0),  # a little old: extrapolated by half a gap
        ((0.970, 0.971), NO_COMMANDS, 6.0),  # long ago: extrapolated by at most one gap beyond the last
        ((1.020, 1.021), NO_COMMANDS, 0.0),  # long after: extrapolated by at most one gap before the first
        ((1.005, 1.005), NO_COMMANDS, 4.0),  # the same message: unchanged
        ((1.006, 1.004), NO_COMMANDS, 4.0),
        # the current of each of two commands counts for its time
        ((0.999, 1.009), (0.995, 1.002), 3.6),  # the earlier one for two tenths
        ((0.999, 1.009), (0.990, 0.9995), 4.0),  # the later one for all of it
        ((1.008, 1.012), (1.000, 1.011), 2.0),  # the earlier one for all of it
        # currents that do not answer the last two commands are interpolated
        ((0.999, 1.009), (1.000, 1.005), 3.2),  # the earlier current answers an older command
        ((0.999, 1.009), (0.990, 1.0095), 3.2),  # the later current does not answer the later command yet
        ((0.999, 1.009), (0.990, 0.9985), 3.2),  # both currents answer the later command
        ((0.999, 1.009), (nan, 1.005), 3.2),
    ],
)
def test_the_current_is_that_of_the_moment_between_the_angles(
    stamps_s: tuple[float, float], commands_s: CommandTimes, current_a: float
) -> None:
    before = DriveState(0.0, 0.0, 1.00, 2.0, stamps_s[0])
    now = DriveState(0.1, 1.0, 1.01, 4.0, stamps_s[1])
    assert motion_between(before, now, commands_s)[3] == pytest.approx(current_a)


@pytest.mark.parametrize(("before", "after"), [(nan, 1.0), (1.0, nan), (inf, 1.0), (1.0, -inf)])
def test_unknown_velocities_leave_inertia_out(before: float, after: float) -> None:
    for motion in (motion_between, motion_at):
        assert motion(sample(0.1, before, 2.0, 1.0), sample(0.3, after, 4.0, 1.01))[2] == 0.0


def test_an_unknown_joint_does_not_invalidate_the_other_one() -> None:
    loads = JointLoads(GEOMETRY, DRIVE)
    loads.update(sample(0.0, nan, 0.0, 1.0), sample(0.0, 0.0, 0.0, 1.0))
    load = loads.update(sample(0.01, 1.0, 0.0, 1.01), sample(0.01, 1.0, 0.0, 1.01))
    assert load is not None
    assert isfinite(load.sweep_nm)
    assert load.adduction_nm == pytest.approx(
        MASS.adduction_inertia_kg_m2 * 100.0 - MASS.gravity_torques_nm(load.sweep_rad, load.adduction_rad)[1]
    )


# what is new


def test_a_sample_that_repeats_the_one_before_gives_no_load_until_a_reset() -> None:
    loads = JointLoads(GEOMETRY, DRIVE)
    pair = (sample(0.1, 1.0, 2.0, 1.0), sample(0.2, 1.0, 2.0, 1.0))
    first = loads.update(*pair)
    sweep, adduction = (each._replace(angle_stamp_s=1.1, current_stamp_s=1.1) for each in pair)
    assert first is not None and loads.update(*pair) is loads.update(sweep, adduction) is None
    loads.reset()
    assert loads.update(*pair) == first


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("field", ["angle_rad", "current_a"])
def test_a_change_of_any_angle_or_current_is_new(index: int, field: str) -> None:
    loads = JointLoads(GEOMETRY, DRIVE)
    pair = [sample(0.1, 1.0, 2.0, 1.0), sample(0.2, 1.0, 2.0, 1.0)]
    loads.update(pair[0], pair[1])
    change: dict[str, Any] = {field: 0.5}
    pair[index] = pair[index]._replace(**change)
    assert loads.update(pair[0], pair[1]) is not None


anything = st.floats()
samples = st.builds(DriveState, anything, anything, anything, anything, anything)


@given(st.lists(st.tuples(samples, samples, st.tuples(anything, anything)), max_size=5))
def test_no_finite_angle_and_current_make_it_raise(
    rows: list[tuple[DriveState, DriveState, CommandTimes]],
) -> None:
    """The estimator skips samples whose angle or current is not finite."""
    loads = JointLoads(GEOMETRY, DRIVE)
    for sweep, adduction, commands_s in rows:
        if np.isfinite([sweep.angle_rad, adduction.angle_rad, sweep.current_a, adduction.current_a]).all():
            loads.update(sweep, adduction, commands_s)
