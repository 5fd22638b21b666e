"""The PD law's signs, and its gravity term against the numeric gradient of potential energy."""

from collections import deque
from math import inf, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.gait.joint_path import still
from control.joint_pd import (
    damping_torques_nm,
    joint_torques_nm,
    largest_damping_nm_s_rad,
    largest_stiffness_nm_rad,
    phase_margin_rad,
)
from control.parameters.arm_mass import ArmMass
from control.parameters.joint_gains import JointGains
from control.rate import PERIOD_S
from control.records import DriveState, DriveStates, JointAngles, Joints, JointTarget
from tests.control.synthetic_states import states_at

Velocities = tuple[float, float, float, float]
WEIGHTLESS = ArmMass(arm_mass_kg=0.0)
angles = st.floats(-pi / 2, pi / 2)
poses = st.builds(Joints, angles, angles, angles, angles)
speeds = st.floats(-100.0, 100.0)
speeds_of_four = st.tuples(speeds, speeds, speeds, speeds)
gains_of_any_size = st.builds(JointGains, *[st.floats(0.0, 5.0)] * 4)
trusts = st.builds(Joints, *[st.booleans()] * 4)
masses = st.builds(ArmMass, arm_mass_kg=st.floats(0.0, 20.0), center_of_mass_m=st.floats(0.0, 1.0))


def turning(velocities: Velocities, angle_rad: float = 0.3) -> DriveStates:
    a, b, c, d = (DriveState(angle_rad=angle_rad, velocity_rad_s=velocity) for velocity in velocities)
    return Joints(a, b, c, d)


def potential_energy_j(mass: ArmMass, sweep_rad: float, adduction_rad: float) -> float:
    """Return m g times the height of a point on the arm, by rotation matrices."""
    arm = np.array([np.sin(sweep_rad), np.cos(sweep_rad), 0.0]) * mass.center_of_mass_m
    about_x = np.array([np.sin(adduction_rad), np.cos(adduction_rad)])
    return float(mass.arm_mass_kg * 9.81 * about_x @ arm[1:])


@given(masses, angles, angles)
def test_gravity_torques_are_the_downhill_gradient_of_potential_energy(
    mass: ArmMass, sweep: float, adduction: float
) -> None:
    step = 1e-5
    by_sweep = potential_energy_j(mass, sweep + step, adduction) - potential_energy_j(mass, sweep - step, adduction)
    by_adduction = potential_energy_j(mass, sweep, adduction + step) - potential_energy_j(mass, sweep, adduction - step)
    expected = (-by_sweep / (2.0 * step), -by_adduction / (2.0 * step))
    assert mass.gravity_torques_nm(sweep, adduction) == pytest.approx(expected, abs=1e-6)


@given(masses, poses)
def test_an_arm_at_its_target_gets_exactly_what_balances_gravity(mass: ArmMass, pose: JointAngles) -> None:
    torques = joint_torques_nm(still(pose), states_at(pose), JointGains(), mass, 1.0)
    for flipper in (0, 2):
        gravity = mass.gravity_torques_nm(pose[flipper], pose[flipper + 1])
        assert torques[flipper] + gravity[0] == 0.0
        assert torques[flipper + 1] + gravity[1] == 0.0


@pytest.mark.parametrize("joint", range(4))
def test_each_joint_is_pushed_toward_its_own_target_with_its_own_gains(joint: int) -> None:
    gains = JointGains(8.0, 0.06, 10.0, 0.08)
    target = [JointTarget(0.3, 0.5)] * 4
    target[joint] = JointTarget(0.4, 2.5)
    torques = joint_torques_nm(Joints(*target), turning((0.5, 0.5, 0.5, 0.5)), gains, WEIGHTLESS, 1.0)
    expected = [0.0] * 4
    expected[joint] = (0.8 + 0.12) if joint % 2 == 0 else (1.0 + 0.16)
    assert torques == pytest.approx(expected)


@given(poses, poses, st.floats(0.0, 1.0))
def test_the_fade_scales_every_torque_alike(target: JointAngles, pose: JointAngles, fade: float) -> None:
    whole = joint_torques_nm(still(target), states_at(pose), JointGains(), ArmMass(), 1.0)
    faded = joint_torques_nm(still(target), states_at(pose), JointGains(), ArmMass(), fade)
    assert faded == pytest.approx([fade * torque for torque in whole], abs=1e-12)


@given(speeds_of_four, angles, gains_of_any_size, trusts, st.floats(0.0, 5.0))
def test_joints_are_braked_in_proportion_to_their_speed_up_to_a_cap_where_their_encoder_is_trusted(
    velocities: Velocities, angle_rad: float, gains: JointGains, trusted: Joints[bool], largest_nm: float
) -> None:
    torques = damping_torques_nm(turning(velocities, angle_rad), gains, trusted, largest_nm)
    dampings = (gains.sweep_damping_nm_s_rad, gains.adduction_damping_nm_s_rad) * 2
    for torque_nm, velocity, damping, trust in zip(torques, velocities, dampings, trusted, strict=True):
        assert torque_nm == pytest.approx(np.clip(-damping * velocity, -largest_nm, largest_nm) if trust else 0.0)


@pytest.mark.parametrize("damping_nm_s_rad", [0.03, 0.06, 0.12])
def test_the_phase_margin_says_where_a_delayed_joint_begins_to_oscillate(damping_nm_s_rad: float) -> None:
    """A joint in small steps decays below the bound and grows above it. Each tick holds the torque of its motion 2 ms
    before.
    """
    inertia_kg_m2, ticks, steps = 0.0004, 150, 80
    step_s = PERIOD_S / steps
    low, high = 0.0, 100.0
    while high - low > 1e-6:
        middle = (low + high) / 2.0
        stable = phase_margin_rad(middle, damping_nm_s_rad, inertia_kg_m2) > 0.0
        low, high = (middle, high) if stable else (low, middle)

    def grows(stiffness_nm_rad: float) -> bool:
        angle_rad, velocity_rad_s, peaks = 0.01, 0.0, [0.0, 0.0]
        late = deque([(angle_rad, velocity_rad_s)] * (round(0.002 / step_s) + 1))
        for step in range(ticks * steps):
            late.append((angle_rad, velocity_rad_s))
            old_rad, old_rad_s = late.popleft()
            if step % steps == 0:
                torque_nm = -stiffness_nm_rad * old_rad - damping_nm_s_rad * old_rad_s
            velocity_rad_s += step_s * torque_nm / inertia_kg_m2
            angle_rad += step_s * velocity_rad_s
            half = step >= ticks * steps // 2
            peaks[half] = max(peaks[half], abs(angle_rad))
        return peaks[1] > peaks[0]

    assert not grows(0.9 * low) and grows(1.1 * low)


@pytest.mark.parametrize("damping_nm_s_rad", [0.001, 0.03, 0.06, 0.12])
def test_the_largest_gains_leave_five_degrees_of_margin(damping_nm_s_rad: float) -> None:
    stiffness_nm_rad = largest_stiffness_nm_rad(damping_nm_s_rad, 0.0004)
    assert phase_margin_rad(stiffness_nm_rad, damping_nm_s_rad, 0.0004) == pytest.approx(radians(5.0))
    assert phase_margin_rad(0.0, largest_damping_nm_s_rad(0.0004), 0.0004) == pytest.approx(radians(5.0))
    assert phase_margin_rad(0.0, 0.0, 0.0004) == inf
