"""The targets of the controller in each mode, read back through gains that turn torques into targets."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan, radians

import pytest

from control.controller import DAMPING_NM, DAMPING_S, RAISING_S, RESTING, SETTLED_S, SOFT_STOP_S, Controller, WalkOrder
from control.gait.recovery import Recovery
from control.gait.stride_table import crutching, stride_duration_s
from control.geometry import FlipperGeometry
from control.limits import JointRange
from control.modes import MOVING, Mode
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.parameters.joint_gains import JointGains
from control.parameters.motion_parameters import MotionParameters
from control.parameters.recovery_parameters import RecoveryParameters
from control.rate import PERIOD_S
from control.records import DriveState, DriveStates, FlipperJoints, JointAngles, Joints, Phase, same_for_each
from tests.control.synthetic_states import NO_TORQUE, states_at

GEOMETRY, GAIT = FlipperGeometry(), GaitParameters()
POSE = Joints(0.2, -0.4, 0.3, -0.5)
RAISED = Joints(0.2, 0.0, 0.3, 0.0)
FRONT = Joints(radians(30.0), 0.0, radians(30.0), 0.0)
SPRING = JointGains(1.0, 0.0, 1.0, 0.0)  # torque = wanted angle - measured angle
DAMPER = JointGains(0.0, 1.0, 0.0, 1.0)  # torque = wanted velocity - measured velocity
RANGES = same_for_each(JointRange(radians(-60.0), radians(60.0)), JointRange(radians(-75.0), radians(45.0)))
APART = replace(crutching(replace(GAIT, swing_duration_s=0.4)), right_offset_fraction=0.5)
STILL_MODES = sorted(set(Mode) - MOVING)


def recovery() -> Recovery:
    return Recovery(RecoveryParameters(attempts=0), GEOMETRY, GAIT, RANGES)


def weightless(gains: JointGains = SPRING) -> Controller:
    """Return a controller without gravity term and without fade, so that every torque shows its target."""
    return Controller(GAIT, GEOMETRY, gains, ArmMass(arm_mass_kg=0.0), MotionParameters(1.0, 0.0), recovery())


def heavy(motion: MotionParameters = MotionParameters()) -> Controller:  # noqa: B008 - immutable
    return Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), motion, recovery())


def ordered(order: WalkOrder = WalkOrder(0.03)) -> Controller:  # noqa: B008 - immutable
    controller = weightless()
    controller.order = order
    return controller


def walking(order: WalkOrder = WalkOrder(0.03)) -> Controller:  # noqa: B008 - immutable
    """Return a controller in the first tick of its gait."""
    controller = ordered(order)
    path_to_the_gait(controller)
    return controller


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


@pytest.mark.parametrize("mode", [*STILL_MODES, Mode.DAMPING])
def test_modes_that_may_not_move_and_damping_at_rest_want_exactly_nothing(mode: Mode) -> None:
    controller = heavy()
    controller.order = WalkOrder(0.03)
    for before in sorted(MOVING - {Mode.DAMPING}):
        for _ in range(500):
            controller.step(PERIOD_S, before, states_at(POSE))
        assert controller.step(PERIOD_S, mode, states_at(Joints(1.0, 1.0, 1.0, 1.0))) == NO_TORQUE
        assert controller.target is RESTING


def test_hold_keeps_the_pose_that_was_measured_when_it_began_also_in_a_walk_that_a_fault_ends() -> None:
    for controller in (weightless(), walking()):
        assert wanted_pose(controller, Mode.HOLD, POSE) == pytest.approx(POSE)
        assert wanted_pose(controller, Mode.HOLD, Joints(0.0, 0.0, 0.0, 0.0)) == pytest.approx(POSE)


def test_the_torque_after_every_arming_is_a_ramp_from_nothing() -> None:
    controller = heavy(MotionParameters(fade_in_s=0.5))
    for off in (Mode.ARMING, Mode.FAULT):
        controller.step(PERIOD_S, off, states_at(POSE))
        torques = [controller.step(PERIOD_S, Mode.HOLD, states_at(POSE)) for _ in range(300)]
        whole = torques[-1]
        assert whole[1] > 0.01  # the arm's weight
        for tick, torque in enumerate(torques, start=1):
            fraction = min(1.0, tick * PERIOD_S / 0.5)
            assert torque == pytest.approx([fraction * each for each in whole], abs=1e-12)


def test_a_walk_raises_the_flippers_then_sweeps_them_to_the_front_then_starts_the_gait() -> None:
    controller = ordered()
    wanted_pose(controller, Mode.HOLD)
    poses = path_to_the_gait(controller)[:-1]
    raised = next(index for index, pose in enumerate(poses) if pose[1] == pose[3] == pytest.approx(0.0, abs=1e-12))
    for pose in poses[: raised + 1]:
        assert (pose[0], pose[2]) == pytest.approx((POSE[0], POSE[2]), abs=0.01)
    for pose in poses[raised:]:
        assert (pose[1], pose[3]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert poses[0] == pytest.approx(POSE, abs=1e-3)
    assert poses[-1] == pytest.approx(FRONT)
    assert (controller.target.stride, controller.target.phase) == (0, Phase.INSERTION)


def test_nothing_jumps_where_the_path_hands_over_to_the_gait() -> None:
    controller = ordered()
    poses = path_to_the_gait(controller)[-10:]
    poses += [wanted_pose(controller, Mode.WALKING) for _ in range(10)]
    steps = [max(abs(b - a) for a, b in zip(p, q, strict=True)) for p, q in zip(poses, poses[1:], strict=False)]
    assert 1e-6 < max(steps) < 0.002  # rad in a tick, against 0.03 in extraction


def test_the_gait_moves_both_flippers_alike_at_the_ordered_depth() -> None:
    controller, deepest = walking(WalkOrder(0.04)), 0.0
    for _ in range(600):
        sweep, adduction, right_sweep, right_adduction = wanted_pose(controller, Mode.WALKING)
        assert (sweep, adduction) == pytest.approx((right_sweep, right_adduction))
        assert GEOMETRY.depth_m(sweep, adduction) == pytest.approx(controller.target.depth_m, abs=1e-9)
        deepest = max(deepest, controller.target.depth_m)
    assert deepest == pytest.approx(0.04)


def test_a_walk_is_finished_after_the_strides_that_were_ordered_and_without_a_number_never() -> None:
    counted, endless, ticks = walking(WalkOrder(0.03, strides=2)), walking(WalkOrder(0.03, strides=0)), 1
    while not counted.walk_finished:
        wanted_pose(counted, Mode.WALKING)
        ticks += 1
    assert ticks * PERIOD_S == pytest.approx(2.0 * stride_duration_s(GAIT, GEOMETRY, 0.03), abs=PERIOD_S)
    for _ in range(2000):
        wanted_pose(endless, Mode.WALKING)
        assert not endless.walk_finished
    assert endless.target.stride >= 2


def deepest_of(controller: Controller, strides: int, next_depth_m: Callable[[int], float]) -> list[list[float]]:
    """Walk, and return the greatest depth of each stride of the left and the right flipper, which are apart."""
    deepest_m: list[list[float]] = [[], []]
    while controller.gait.stride < strides:
        controller.gait.next_depth_m = next_depth_m(controller.gait.stride)  # as at each close
        pose = wanted_pose(controller, Mode.WALKING)
        assert controller.target.phase is Phase.STROKE and controller.target.sweep_rad == pytest.approx(pose[0])
        for reached_m, (sweep_rad, lift_rad) in zip(deepest_m, pose.flippers, strict=True):
            depth_m = GEOMETRY.depth_m(sweep_rad, lift_rad)
            if depth_m < 0.0:
                reached_m.append(0.0)
            else:
                reached_m[-1] = max(reached_m[-1], depth_m)
    return [[depth_m for depth_m in reached_m if depth_m] for reached_m in deepest_m]


def test_flippers_apart_both_take_the_depths_in_turn() -> None:
    depths_m = (0.02, 0.04, 0.03)
    controller = walking(WalkOrder(depths_m[0], adaptive=False, depths_m=depths_m, gait=APART))
    left_m, right_m = deepest_of(controller, 4, lambda stride: controller.order.depth_of(stride + 1))
    assert left_m == pytest.approx([*depths_m, depths_m[0]], abs=1e-4)
    assert right_m[:3] == pytest.approx(depths_m, abs=1e-4)


def test_flippers_apart_take_an_adapted_depth_each_where_its_next_stride_begins() -> None:
    """The later one follows half a stride behind, with the choice of that time."""
    controller = walking(WalkOrder(0.03, gait=APART))
    left_m, right_m = deepest_of(controller, 3, lambda stride: (0.02, 0.04, 0.025)[stride])
    assert left_m == pytest.approx([0.03, 0.02, 0.04], abs=1e-4)
    assert right_m[:2] == pytest.approx([0.03, 0.04], abs=1e-4)


def test_of_flippers_apart_one_stands_still_while_the_other_one_is_stuck_and_goes_on_after_it() -> None:
    controller = ordered(WalkOrder(0.03, adaptive=False, gait=APART))
    controller.recovery = Recovery(RecoveryParameters(), GEOMETRY, GAIT, RANGES)
    pose, held = path_to_the_gait(controller)[-1], None
    lefts, phases = list[FlipperJoints[float]](), list[Phase]()

    def follow() -> JointAngles:
        """Step with joints that follow, but the stuck ones."""
        wanted = wanted_pose(controller, Mode.WALKING, pose)
        lefts.append(wanted.flippers[0])
        phases.append(controller.target.phase)
        return wanted

    while Phase.RECOVERY not in phases:
        wanted = follow()
        if held is None and GEOMETRY.depth_m(*wanted[2:]) > 0.02:
            held = wanted.flippers[1]
        pose = Joints(*wanted[:2], *(held or wanted[2:]))
    parameters = controller.recovery.parameters
    for _ in range(round((parameters.pause_s + 0.2) / PERIOD_S)):
        wanted = follow()
        pose = Joints(*wanted[:2], *pose[2:])
    stood = round((parameters.grace_s + parameters.pause_s + 0.2) / PERIOD_S)
    assert all(left == pytest.approx(lefts[-1]) for left in lefts[-stood + 2 :])
    assert lefts[-stood - 10] != pytest.approx(lefts[-1])
    assert held and wanted[3] > held.adduction + 0.01  # pulled
    pose = Joints(*wanted[:2], *RAISED[2:])
    for _ in range(10):
        follow()
    assert phases[-1] is Phase.STROKE and lefts[-1] != pytest.approx(lefts[-11])


def raise_flippers(controller: Controller) -> list[JointAngles]:
    """Return the poses of a stop of flippers that stay in their pose."""
    poses = [wanted_pose(controller, Mode.STOPPING)]
    while not controller.raised:
        poses.append(wanted_pose(controller, Mode.STOPPING))
        assert len(poses) < 2000
    return poses


def test_stopping_raises_the_flippers_where_they_are_and_hold_keeps_them_there() -> None:
    on_the_path_to_the_front = ordered()
    for _ in range(20):
        wanted_pose(on_the_path_to_the_front, Mode.WALKING)
    for controller in (walking(), on_the_path_to_the_front):
        poses = raise_flippers(controller)
        assert poses[0] == pytest.approx(POSE, abs=1e-3)
        assert all((pose[0], pose[2]) == pytest.approx((POSE[0], POSE[2])) for pose in poses)
        assert wanted_pose(controller, Mode.STOPPING, RAISED) == pytest.approx(RAISED)
        for _ in range(2):
            assert wanted_pose(controller, Mode.HOLD, Joints(0.1, -0.1, 0.1, -0.1)) == pytest.approx(RAISED)
        assert not controller.raised  # it is reported only while stopping


def test_flippers_that_the_mud_keeps_down_are_held_where_they_are_after_a_stop() -> None:
    controller = walking()
    raise_flippers(controller)
    assert controller.step(PERIOD_S, Mode.HOLD, states_at(POSE)) == pytest.approx(NO_TORQUE)


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


WITHOUT_LEFT = Joints(False, False, True, True)


def test_damping_brakes_each_joint_within_its_torque_limit_where_its_encoder_is_trusted() -> None:
    fast = turning_at((2.0, -2.0, 100.0, -100.0))
    assert heavy().step(PERIOD_S, Mode.DAMPING, fast) == pytest.approx((-0.12, 0.16, -DAMPING_NM, DAMPING_NM))
    torques = heavy().step(PERIOD_S, Mode.DAMPING, turning_at((2.0, nan, 2.0, 2.0)), WITHOUT_LEFT)
    assert torques == pytest.approx((0.0, 0.0, -0.12, -0.16))


@pytest.mark.parametrize(
    ("velocities", "trusted", "within_s"),
    [
        ((0.0, 0.0, 0.0, 0.0), None, SETTLED_S),
        ((0.005, -0.005, 0.005, -0.005), None, SETTLED_S),
        ((nan, 5.0, 0.0, 0.0), WITHOUT_LEFT, SETTLED_S),  # a joint without encoder is not waited for
        ((0.11, 0.0, 0.0, 0.0), None, DAMPING_S),
        ((0.0, 0.0, 0.0, -0.11), None, DAMPING_S),
        ((0.0, nan, 0.0, 0.0), None, DAMPING_S),
    ],
)
def test_joints_have_settled_once_all_rest_for_a_while_and_are_given_up_in_bounded_time(
    velocities: tuple[float, ...], trusted: Joints[bool] | None, within_s: float
) -> None:
    assert ticks_until_settled(velocities, trusted) == pytest.approx(within_s / PERIOD_S, abs=1)


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


@pytest.mark.parametrize(("longest_s", "ticks"), [(1.0, 380), (0.0, inf), (10.0, inf)])
def test_rested_is_true_after_the_configured_time_and_never_without_one(longest_s: float, ticks: float) -> None:
    controller = heavy(MotionParameters(longest_hold_s=longest_s))
    for tick in range(1, 1000):
        controller.step(PERIOD_S, Mode.HOLD, states_at(POSE))
        assert controller.rested is (tick >= ticks)


def test_the_hold_time_restarts_with_every_hold_and_every_move_and_stops_in_other_modes() -> None:
    controller = heavy(MotionParameters(longest_hold_s=1.0))
    controller.order = WalkOrder(0.03)
    for mode in (Mode.HOLD, Mode.WALKING, Mode.STOPPING, Mode.HOLD, Mode.HOLD):
        for _ in range(370):
            controller.step(PERIOD_S, mode, states_at(RAISED))
            assert not controller.rested
        controller.move([None, 0.0, None, None])


def test_a_move_that_is_stopped_on_its_way_leaves_the_joints_at_rest_where_it_stopped() -> None:
    controller = weightless(DAMPER)
    wanted_pose(controller, Mode.HOLD)
    controller.move([0.5, None, None, None])
    for _ in range(100):
        moving_nm = controller.step(PERIOD_S, Mode.HOLD, states_at(POSE))
    stopped = controller.joint_targets
    controller.end_move()
    assert moving_nm[0] > 0.1 and controller.step(PERIOD_S, Mode.HOLD, states_at(POSE)) == NO_TORQUE
    assert stopped and controller.joint_targets and controller.joint_targets[0].angle_rad == stopped[0].angle_rad


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
