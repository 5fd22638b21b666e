"""The targets of the controller in each mode, read back through gains that turn torques into targets."""

from math import nan, radians

import pytest

from control.controller import DAMPING_NM, DAMPING_S, RAISING_S, RESTING, SETTLED_S, SOFT_STOP_S, Controller, WalkOrder
from control.gait.gait import stride_duration_s
from control.gait.recovery import Recovery
from control.geometry import FlipperGeometry
from control.limits import JointRange
from control.modes import MOVING, Mode
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.parameters.joint_gains import JointGains
from control.parameters.motion_parameters import MotionParameters
from control.parameters.recovery_parameters import RecoveryParameters
from control.rate import PERIOD_S
from control.records import DriveState, DriveStates, JointAngles, Joints, Phase, Torques, same_for_each
from tests.control.synthetic_states import NO_TORQUE, states_at

GEOMETRY, GAIT = FlipperGeometry(), GaitParameters()
POSE = Joints(0.2, -0.4, 0.3, -0.5)
RAISED = Joints(0.2, 0.0, 0.3, 0.0)
FRONT = Joints(radians(30.0), 0.0, radians(30.0), 0.0)
SPRING = JointGains(1.0, 0.0, 1.0, 0.0)  # torque = wanted angle - measured angle
DAMPER = JointGains(0.0, 1.0, 0.0, 1.0)  # torque = wanted velocity - measured velocity
RANGES = same_for_each(JointRange(radians(-60.0), radians(60.0)), JointRange(radians(-75.0), radians(45.0)))
STILL_MODES = sorted(set(Mode) - MOVING)


def recovery(attempts: int = 0) -> Recovery:
    return Recovery(RecoveryParameters(attempts), GEOMETRY, GAIT, RANGES)


def weightless(gains: JointGains = SPRING, attempts: int = 0) -> Controller:
    """Return a controller without gravity term and without fade, so that every torque shows its target."""
    return Controller(GAIT, GEOMETRY, gains, ArmMass(arm_mass_kg=0.0), MotionParameters(1.0, 0.0), recovery(attempts))


def wanted_pose(controller: Controller, mode: Mode, pose: JointAngles = POSE) -> JointAngles:
    a, b, c, d = (
        torque + angle for torque, angle in zip(controller.step(PERIOD_S, mode, states_at(pose)), pose, strict=True)
    )
    return Joints(a, b, c, d)


def path_to_the_gait(controller: Controller) -> list[JointAngles]:
    poses = [wanted_pose(controller, Mode.WALKING)]
    while controller.target is RESTING:
        poses.append(wanted_pose(controller, Mode.WALKING))
        assert len(poses) < 2000
    return poses


@pytest.mark.parametrize("mode", STILL_MODES)
def test_modes_that_may_not_move_want_exactly_nothing(mode: Mode) -> None:
    controller = Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), MotionParameters(), recovery())
    for before in sorted(MOVING):
        for _ in range(10):
            controller.step(PERIOD_S, before, states_at(POSE))
        assert controller.step(PERIOD_S, mode, states_at(Joints(1.0, 1.0, 1.0, 1.0))) == NO_TORQUE
        assert controller.target is RESTING


def test_hold_keeps_the_pose_that_was_measured_when_it_began() -> None:
    controller = weightless()
    assert wanted_pose(controller, Mode.HOLD, POSE) == pytest.approx(POSE)
    assert wanted_pose(controller, Mode.HOLD, Joints(0.0, 0.0, 0.0, 0.0)) == pytest.approx(POSE)


def test_the_torque_after_arming_is_a_ramp_from_nothing() -> None:
    controller = Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), MotionParameters(fade_in_s=0.5), recovery())
    controller.step(PERIOD_S, Mode.ARMING, states_at(POSE))
    torques = [controller.step(PERIOD_S, Mode.HOLD, states_at(POSE)) for _ in range(300)]
    whole = torques[-1]
    assert whole[1] > 0.01  # the arm's weight
    for tick, torque in enumerate(torques, start=1):
        fraction = min(1.0, tick * PERIOD_S / 0.5)
        assert torque == pytest.approx([fraction * each for each in whole], abs=1e-12)


def test_the_ramp_starts_again_after_every_arming() -> None:
    controller = Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), MotionParameters(fade_in_s=0.5), recovery())
    first = controller.step(PERIOD_S, Mode.HOLD, states_at(POSE))
    for _ in range(300):
        controller.step(PERIOD_S, Mode.HOLD, states_at(POSE))
    controller.step(PERIOD_S, Mode.FAULT, states_at(POSE))
    assert controller.step(PERIOD_S, Mode.HOLD, states_at(POSE)) == first


def test_a_walk_raises_the_flippers_then_sweeps_them_to_the_front_then_starts_the_gait() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    wanted_pose(controller, Mode.HOLD)
    poses = path_to_the_gait(controller)[:-1]
    raised = next(index for index, pose in enumerate(poses) if pose[1] == pose[3] == pytest.approx(0.0, abs=1e-12))
    for pose in poses[: raised + 1]:
        assert (pose[0], pose[2]) == pytest.approx((POSE[0], POSE[2]), abs=0.01)
    for pose in poses[raised:]:
        assert (pose[1], pose[3]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert poses[0] == pytest.approx(POSE, abs=1e-3)
    assert poses[-1] == pytest.approx(FRONT)
    assert controller.target.phase is Phase.INSERTION
    assert controller.target.stride == 0


def test_nothing_jumps_where_the_path_hands_over_to_the_gait() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    poses = path_to_the_gait(controller)[-10:]
    poses += [wanted_pose(controller, Mode.WALKING) for _ in range(10)]
    steps = [max(abs(b - a) for a, b in zip(p, q, strict=True)) for p, q in zip(poses, poses[1:], strict=False)]
    assert 1e-6 < max(steps) < 0.002  # rad in a tick, against 0.03 in extraction


def test_the_gait_moves_both_flippers_alike_at_the_ordered_depth() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.04)
    path_to_the_gait(controller)
    deepest = 0.0
    for _ in range(600):
        sweep, adduction, right_sweep, right_adduction = wanted_pose(controller, Mode.WALKING)
        assert (sweep, adduction) == pytest.approx((right_sweep, right_adduction))
        assert GEOMETRY.depth_m(sweep, adduction) == pytest.approx(controller.target.depth_m, abs=1e-9)
        deepest = max(deepest, controller.target.depth_m)
    assert deepest == pytest.approx(0.04)


def test_the_velocities_wanted_in_the_gait_are_those_of_the_angles() -> None:
    def gait_only(gains: JointGains) -> list[Torques]:
        controller = weightless(gains)
        controller.order = WalkOrder(0.03)
        while controller.target is RESTING:
            controller.step(PERIOD_S, Mode.WALKING, states_at(FRONT))
        return [controller.step(PERIOD_S / 20.0, Mode.WALKING, states_at(FRONT)) for _ in range(8000)]

    angles, velocities = gait_only(SPRING), gait_only(DAMPER)
    for before, now, after in zip(angles, velocities[1:], angles[2:], strict=False):
        slopes = [(b - a) / (2.0 * PERIOD_S / 20.0) for a, b in zip(before, after, strict=True)]
        assert now == pytest.approx(slopes, abs=0.01)


def test_a_walk_is_finished_after_the_strides_that_were_ordered() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03, strides=2)
    ticks = len(path_to_the_gait(controller)) - len(path_to_the_gait(weightless()))
    assert ticks == 0
    ticks = 1
    while not controller.walk_finished:
        wanted_pose(controller, Mode.WALKING)
        ticks += 1
    assert ticks * PERIOD_S == pytest.approx(2.0 * stride_duration_s(GAIT, GEOMETRY, 0.03), abs=PERIOD_S)


def test_a_walk_without_a_number_of_strides_never_finishes_by_itself() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03, strides=0)
    path_to_the_gait(controller)
    for _ in range(2000):
        wanted_pose(controller, Mode.WALKING)
        assert not controller.walk_finished
    assert controller.target.stride >= 2


def test_stopping_raises_the_flippers_where_they_are_and_hold_keeps_them_there() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    path_to_the_gait(controller)
    poses = [wanted_pose(controller, Mode.STOPPING)]
    while not controller.raised:
        poses.append(wanted_pose(controller, Mode.STOPPING))
        assert len(poses) < 2000
    assert poses[0] == pytest.approx(POSE, abs=1e-3)
    assert all((pose[0], pose[2]) == pytest.approx((POSE[0], POSE[2])) for pose in poses)
    assert wanted_pose(controller, Mode.STOPPING, RAISED) == pytest.approx(RAISED)
    sagged = Joints(0.1, -0.1, 0.1, -0.1)
    assert wanted_pose(controller, Mode.HOLD, sagged) == pytest.approx(RAISED)
    assert wanted_pose(controller, Mode.HOLD, sagged) == pytest.approx(RAISED)


def test_flippers_that_the_mud_keeps_down_are_held_where_they_are_after_a_stop() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    path_to_the_gait(controller)
    wanted_pose(controller, Mode.STOPPING)
    while not controller.raised:
        wanted_pose(controller, Mode.STOPPING)
    assert controller.step(PERIOD_S, Mode.HOLD, states_at(POSE)) == pytest.approx(NO_TORQUE)


def test_a_stop_on_the_path_to_the_front_raises_the_flippers_too() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    for _ in range(20):
        wanted_pose(controller, Mode.WALKING)
    for _ in range(1000):
        pose = wanted_pose(controller, Mode.STOPPING)
    assert controller.raised
    assert pose == pytest.approx(RAISED)


def test_raised_is_reported_only_while_stopping() -> None:
    controller = weightless()
    for _ in range(1000):
        wanted_pose(controller, Mode.STOPPING, RAISED)
    assert controller.raised
    wanted_pose(controller, Mode.HOLD, RAISED)
    assert not controller.raised


def test_a_second_walk_starts_again_at_stride_zero() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    path_to_the_gait(controller)
    for _ in range(1000):
        wanted_pose(controller, Mode.WALKING)
    assert controller.target.stride == 1
    wanted_pose(controller, Mode.STOPPING)
    wanted_pose(controller, Mode.HOLD)
    path_to_the_gait(controller)
    assert (controller.target.stride, controller.target.phase) == (0, Phase.INSERTION)


def test_outside_of_the_gait_the_target_is_at_rest() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    for mode in (Mode.HOLD, Mode.WALKING, Mode.STOPPING, Mode.HOLD):
        wanted_pose(controller, mode)
        assert controller.target is RESTING


def turning_at(velocities: tuple[float, ...], for_s: float = 0.0) -> DriveStates:
    a, b, c, d = (
        DriveState(angle_rad=angle + velocity * for_s, velocity_rad_s=velocity)
        for angle, velocity in zip(POSE, velocities, strict=True)
    )
    return Joints(a, b, c, d)


def ticks_until_settled(velocities: tuple[float, ...], trusted: Joints[bool] | None = None) -> int:
    controller = weightless()
    for tick in range(1, 2000):
        controller.step(PERIOD_S, Mode.DAMPING, turning_at(velocities, tick * PERIOD_S), trusted)
        if controller.settled:
            return tick
    raise AssertionError("it never settled")


REST = Joints(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("before", [Mode.HOLD, Mode.WALKING, Mode.STOPPING])
def test_damping_forgets_every_target_at_once(before: Mode) -> None:
    controller = Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), MotionParameters(), recovery())
    controller.order = WalkOrder(0.03)
    for _ in range(500):
        controller.step(PERIOD_S, before, states_at(POSE))
    assert controller.step(PERIOD_S, Mode.DAMPING, states_at(POSE)) == NO_TORQUE
    assert controller.target is RESTING


def test_damping_brakes_each_joint_within_its_torque_limit() -> None:
    controller = Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), MotionParameters(), recovery())
    torques = controller.step(PERIOD_S, Mode.DAMPING, turning_at((2.0, -2.0, 100.0, -100.0)))
    assert torques == pytest.approx((-0.12, 0.16, -DAMPING_NM, DAMPING_NM))


def test_a_joint_whose_encoder_is_not_trusted_is_not_damped() -> None:
    controller = weightless(JointGains())
    torques = controller.step(
        PERIOD_S, Mode.DAMPING, turning_at((2.0, nan, 2.0, 2.0)), Joints(False, False, True, True)
    )
    assert torques == pytest.approx((0.0, 0.0, -0.12, -0.16))


def test_joints_have_settled_once_all_rest_for_a_while() -> None:
    assert ticks_until_settled(REST) == pytest.approx(SETTLED_S / PERIOD_S, abs=1)
    assert ticks_until_settled((0.005, -0.005, 0.005, -0.005)) == pytest.approx(SETTLED_S / PERIOD_S, abs=1)


@pytest.mark.parametrize("velocities", [(0.11, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, -0.11), (0.0, nan, 0.0, 0.0)])
def test_joints_that_do_not_rest_are_given_up_in_bounded_time(velocities: tuple[float, ...]) -> None:
    assert ticks_until_settled(velocities) == pytest.approx(DAMPING_S / PERIOD_S, abs=1)


def test_damping_does_not_wait_for_a_joint_without_encoder() -> None:
    ticks = ticks_until_settled((nan, 5.0, 0.0, 0.0), Joints(False, False, True, True))
    assert ticks == pytest.approx(SETTLED_S / PERIOD_S, abs=1)


def test_damping_waits_again_for_a_joint_that_moves_again() -> None:
    controller = weightless()
    for tick in range(1, 220):
        position_s = 1.0 if tick >= 100 else 0.0
        controller.step(PERIOD_S, Mode.DAMPING, turning_at((0.1, 0.0, 0.0, 0.0), position_s))
        assert not (controller.settled and tick < 100 + SETTLED_S / PERIOD_S)
    assert controller.settled


def test_settled_is_true_only_in_the_present_damping() -> None:
    controller = weightless()
    for _ in range(200):
        controller.step(PERIOD_S, Mode.DAMPING, states_at(POSE))
    assert controller.settled
    controller.step(PERIOD_S, Mode.FAULT, states_at(POSE))
    assert not controller.settled
    controller.step(PERIOD_S, Mode.DAMPING, states_at(POSE))
    assert not controller.settled


def test_a_walk_that_a_fault_holds_stays_at_the_measured_pose_with_its_whole_stiffness() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    path_to_the_gait(controller)
    for _ in range(300):
        wanted_pose(controller, Mode.WALKING)
    here = Joints(0.35, -0.6, 0.25, -0.7)
    assert wanted_pose(controller, Mode.HOLD, here) == pytest.approx(here)
    assert wanted_pose(controller, Mode.HOLD, POSE) == pytest.approx(here)


def test_rested_is_true_after_the_configured_time_and_never_without_one() -> None:
    def ticks_held(longest_s: float) -> int | None:
        motion = MotionParameters(longest_hold_s=longest_s)
        controller = Controller(GAIT, GEOMETRY, SPRING, ArmMass(), motion, recovery())
        for tick in range(1, 1000):
            controller.step(PERIOD_S, Mode.HOLD, states_at(POSE))
            if controller.rested:
                return tick
        return None

    assert ticks_held(1.0) == pytest.approx(380, abs=2)
    assert ticks_held(0.0) is None
    assert ticks_held(10.0) is None


def test_the_hold_time_restarts_with_every_hold_and_stops_in_other_modes() -> None:
    motion = MotionParameters(longest_hold_s=1.0)
    controller = Controller(GAIT, GEOMETRY, SPRING, ArmMass(), motion, recovery())
    controller.order = WalkOrder(0.03)
    for mode in (Mode.HOLD, Mode.WALKING, Mode.STOPPING, Mode.HOLD):
        for _ in range(370):
            controller.step(PERIOD_S, mode, states_at(RAISED))
            assert not controller.rested


def test_the_hold_time_restarts_with_every_move() -> None:
    controller = Controller(GAIT, GEOMETRY, SPRING, ArmMass(), MotionParameters(longest_hold_s=1.0), recovery())
    for _ in range(4):
        for _ in range(370):
            controller.step(PERIOD_S, Mode.HOLD, states_at(POSE))
            assert not controller.rested
        controller.move([None, 0.0, None, None])


def stopping_ticks(pose: JointAngles) -> int:
    """Return the ticks of a stop of flippers that no torque moves."""
    controller = weightless()
    for tick in range(1, 3000):
        controller.step(PERIOD_S, Mode.STOPPING, states_at(pose))
        if controller.raised:
            return tick
    raise AssertionError("it never ended")


@pytest.mark.parametrize("low_rad", [-0.2, -0.7, -1.3])
def test_flippers_that_the_mud_keeps_are_waited_for_but_not_long(low_rad: float) -> None:
    ticks = stopping_ticks(Joints(0.0, low_rad, 0.0, low_rad))
    assert ticks * PERIOD_S == pytest.approx(RAISING_S - low_rad, abs=0.15)
    assert ticks * PERIOD_S < SOFT_STOP_S


def test_a_stop_never_takes_longer_than_a_soft_stop_may() -> None:
    """This also holds on a path that is too long, of an arm that was turned far up by hand."""
    assert stopping_ticks(Joints(0.0, 3.0, 0.0, 3.0)) * PERIOD_S == pytest.approx(SOFT_STOP_S, abs=0.01)


def test_targets_count_as_followed_only_where_the_last_torques_followed_them() -> None:
    """A monitor that compares them with the joints would report a path that a hold law replaced."""
    controller = weightless()
    wanted_pose(controller, Mode.HOLD)
    assert controller.followed_targets == controller.joint_targets is not None
    controller.hold_law = lambda held, states: NO_TORQUE
    wanted_pose(controller, Mode.HOLD)
    assert controller.followed_targets is None
    controller.hold_law = None
    assert controller.followed_targets is None  # until the next step
    wanted_pose(controller, Mode.HOLD)
    assert controller.followed_targets == controller.joint_targets is not None
