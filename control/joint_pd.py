"""Joint PD control with gravity feed-forward: τ = k (θ* - θ) + d (ω* - ω) - τ_gravity(α, β).

The drives run in torque mode, so only this law and its limits move the robot.
"""

from collections.abc import Sequence
from itertools import cycle
from math import atan2, inf, pi, radians, sqrt

from control.parameters.arm_mass import ArmMass
from control.parameters.joint_gains import JointGains
from control.rate import PERIOD_S
from control.records import (
    DriveState,
    DriveStates,
    Joints,
    JointTarget,
    JointTargets,
    Torques,
)

LOOP_DELAY_S = 0.002 + PERIOD_S / 2.0  # the age of a position, and half of the tick for which a torque is held
LEAST_MARGIN_RAD = radians(5.0)  # with that delay; the defaults have 19 and 21 degrees


def phase_margin_rad(stiffness_nm_rad: float, damping_nm_s_rad: float, inertia_kg_m2: float) -> float:
    """Return the phase margin of one joint in air, without friction, with the delay T of the loop.

    The open loop is L(iω) = (k + iωd) e^(-iωT) / (-I ω²). Its magnitude is 1 at

        ω² = a²/2 + √(a⁴/4 + b²)        a = d/I, b = k/I

    and there its phase is atan(ωd/k) - ωT above -180°. From zero margin on the joint oscillates at its full torque.
    """
    a, b = damping_nm_s_rad / inertia_kg_m2, stiffness_nm_rad / inertia_kg_m2
    crossover_rad_s = sqrt(a * a / 2.0 + sqrt(a**4 / 4.0 + b * b))
    if crossover_rad_s == 0.0:  # without gains there is no loop
        return inf
    return atan2(crossover_rad_s * damping_nm_s_rad, stiffness_nm_rad) - crossover_rad_s * LOOP_DELAY_S


def largest_damping_nm_s_rad(inertia_kg_m2: float) -> float:
    """Return the damping that has the least margin without stiffness, where ω = d/I."""
    return (pi / 2.0 - LEAST_MARGIN_RAD) / LOOP_DELAY_S * inertia_kg_m2


def largest_stiffness_nm_rad(damping_nm_s_rad: float, inertia_kg_m2: float) -> float:
    """Return the stiffness that has the least margin with this damping, by bisection: more stiffness has less."""
    low, high = 0.0, inertia_kg_m2 / LOOP_DELAY_S**2  # which turns the phase by one radian without damping
    for _ in range(60):
        middle = (low + high) / 2.0
        enough = phase_margin_rad(middle, damping_nm_s_rad, inertia_kg_m2) >= LEAST_MARGIN_RAD
        low, high = (middle, high) if enough else (low, middle)
    return low


class VelocityPrediction:
    """Predicts present velocities from the last two answers of drives that answer only when asked.

    Such a drive measures when a tick's command arrives, and the next tick reads it. With velocities of that age the
    damping drives a joint that stiff mud lets oscillate, from a stiffness of the mud of twice that of the joint on.
    Between the two answers the joint had the acceleration a. Mud and weight act on as they did, and the change of the
    motor's torque since then is known, because this program sent it:

        ω = ω₁ + T (a + (τ₁ - τ₂) / I)        a = (ω₁ - ω₂) / T

    with the torques sent before (τ₁) and before that (τ₂), the tick T and the joint's inertia I: a Smith predictor of
    one tick. Without the torques the joint reacts to its own damping a tick too late, and oscillates in mud of two
    thirds of the stiffness. The angle is not predicted: ahead of the joint it would stiffen fast motions. A prediction
    has √5 times the noise of one answer.
    """

    def __init__(self, asked: Sequence[bool], mass: ArmMass) -> None:
        """`asked`: for each joint, whether its drive answers only when asked."""
        self._asked = asked
        gains = (PERIOD_S / mass.sweep_inertia_kg_m2, PERIOD_S / mass.adduction_inertia_kg_m2)
        self._gains_rad_s_nm = gains * (len(asked) // 2)
        self._before: Sequence[DriveState] = ()
        self._before_nm: Sequence[float] = ()

    def update(self, states: DriveStates, sent_nm: Torques) -> DriveStates:
        """Return the states with the present velocities of the asked drives; `sent_nm` left in the tick before."""
        before, before_nm = self._before or states, self._before_nm or sent_nm
        self._before, self._before_nm = states, sent_nm
        joints = zip(self._asked, before, states, before_nm, sent_nm, self._gains_rad_s_nm, strict=True)
        return Joints(
            *(
                _predicted(old, state, (new_nm - old_nm) * gain_rad_s_nm) if asked else state
                for asked, old, state, old_nm, new_nm, gain_rad_s_nm in joints
            )
        )


def _predicted(before: DriveState, state: DriveState, pushed_rad_s: float) -> DriveState:
    elapsed_s = state.angle_stamp_s - before.angle_stamp_s
    if not PERIOD_S / 2.0 < elapsed_s < 1.5 * PERIOD_S:  # these are not two answers in a row
        return state
    velocity_rad_s = state.velocity_rad_s
    faster_rad_s = (velocity_rad_s - before.velocity_rad_s) * PERIOD_S / elapsed_s
    return DriveState(state.angle_rad, velocity_rad_s + faster_rad_s + pushed_rad_s, *state[2:])


def pd_torque_nm(target: JointTarget, state: DriveState, stiffness_nm_rad: float, damping_nm_s_rad: float) -> float:
    return stiffness_nm_rad * (target.angle_rad - state.angle_rad) + damping_nm_s_rad * (
        target.velocity_rad_s - state.velocity_rad_s
    )


def joint_torques_nm(
    targets: JointTargets, states: DriveStates, gains: JointGains, mass: ArmMass, fade: float
) -> Torques:
    """Return the torques of all joints; `fade` rises from 0 to 1 after arming, so that the joints start smoothly."""
    sweep_stiffness, sweep_damping = gains.sweep_stiffness_nm_rad, gains.sweep_damping_nm_s_rad
    adduction_stiffness, adduction_damping = gains.adduction_stiffness_nm_rad, gains.adduction_damping_nm_s_rad
    torques_nm: list[float] = []
    goals, joints = iter(targets), iter(states)
    for sweep_goal in goals:  # of one flipper after the other: twice as fast as over pairs
        adduction_goal, sweep, adduction = next(goals), next(joints), next(joints)
        sweep_gravity_nm, adduction_gravity_nm = mass.gravity_torques_nm(sweep.angle_rad, adduction.angle_rad)
        sweep_nm = pd_torque_nm(sweep_goal, sweep, sweep_stiffness, sweep_damping)
        adduction_nm = pd_torque_nm(adduction_goal, adduction, adduction_stiffness, adduction_damping)
        torques_nm.append(fade * (sweep_nm - sweep_gravity_nm))
        torques_nm.append(fade * (adduction_nm - adduction_gravity_nm))
    return Joints(*torques_nm)


def damping_torques_nm(states: DriveStates, gains: JointGains, trusted: Joints[bool], largest_nm: float) -> Torques:
    """Return braking torques τ = -d ω of at most `largest_nm`, and none for a joint whose encoder is not trusted."""
    dampings = cycle((gains.sweep_damping_nm_s_rad, gains.adduction_damping_nm_s_rad))
    return Joints(
        *(
            min(max(-damping * state.velocity_rad_s, -largest_nm), largest_nm) if trust else 0.0
            for damping, state, trust in zip(dampings, states, trusted, strict=False)
        )
    )
