"""What the controller wants in each mode, read back through gains that turn torques into targets."""

from math import radians

import pytest

from control.controller import RESTING, Controller, MotionParameters, WalkOrder
from control.gait import GaitParameters, stride_duration_s
from control.geometry import FlipperGeometry
from control.joint_pd import ArmMass, JointGains
from control.limits import JointRange
from control.modes import MOVING, Mode
from control.records import NO_TORQUE, DriveState, DriveStates, JointAngles, Phase, Torques
from control.recovery import Recovery, RecoveryParameters

TICK_S = 1.0 / 380.0
GEOMETRY, GAIT = FlipperGeometry(), GaitParameters()
POSE = (0.2, -0.4, 0.3, -0.5)
RAISED = (0.2, 0.0, 0.3, 0.0)
FRONT = (radians(30.0), 0.0, radians(30.0), 0.0)
SPRING = JointGains(1.0, 0.0, 1.0, 0.0)  # torque = wanted angle - measured angle
DAMPER = JointGains(0.0, 1.0, 0.0, 1.0)  # torque = wanted velocity - measured velocity
RANGES = 2 * (JointRange(radians(-60.0), radians(60.0)), JointRange(radians(-75.0), radians(45.0)))
STILL_MODES = sorted(set(Mode) - MOVING)


def states_at(pose: JointAngles) -> DriveStates:
    a, b, c, d = (DriveState(angle_rad=angle, velocity_rad_s=0.0) for angle in pose)
    return a, b, c, d


def recovery(attempts: int = 0) -> Recovery:
    return Recovery(RecoveryParameters(attempts), GEOMETRY, GAIT, RANGES)


def weightless(gains: JointGains = SPRING, attempts: int = 0) -> Controller:
    """Without gravity term and without fade, so that every torque tells its target."""
    return Controller(GAIT, GEOMETRY, gains, ArmMass(arm_mass_kg=0.0), MotionParameters(1.0, 0.0), recovery(attempts))


def wanted_pose(controller: Controller, mode: Mode, pose: JointAngles = POSE) -> JointAngles:
    a, b, c, d = (
        torque + angle for torque, angle in zip(controller.step(TICK_S, mode, states_at(pose)), pose, strict=True)
    )
    return a, b, c, d


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
            controller.step(TICK_S, before, states_at(POSE))
        assert controller.step(TICK_S, mode, states_at((1.0, 1.0, 1.0, 1.0))) == NO_TORQUE
        assert controller.target is RESTING


def test_hold_keeps_the_pose_that_was_measured_when_it_began() -> None:
    controller = weightless()
    assert wanted_pose(controller, Mode.HOLD, POSE) == pytest.approx(POSE)
    assert wanted_pose(controller, Mode.HOLD, (0.0, 0.0, 0.0, 0.0)) == pytest.approx(POSE)


def test_arming_again_holds_the_new_pose() -> None:
    controller = weightless()
    wanted_pose(controller, Mode.HOLD, POSE)
    wanted_pose(controller, Mode.IDLE, POSE)
    assert wanted_pose(controller, Mode.HOLD, RAISED) == pytest.approx(RAISED)


def test_the_torque_after_arming_is_a_ramp_from_nothing() -> None:
    controller = Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), MotionParameters(fade_in_s=0.5), recovery())
    controller.step(TICK_S, Mode.ARMING, states_at(POSE))
    torques = [controller.step(TICK_S, Mode.HOLD, states_at(POSE)) for _ in range(300)]
    whole = torques[-1]
    assert whole[1] > 0.01  # the arm's weight
    for tick, torque in enumerate(torques, start=1):
        share = min(1.0, tick * TICK_S / 0.5)
        assert torque == pytest.approx([share * each for each in whole], abs=1e-12)


def test_the_ramp_starts_again_after_every_arming() -> None:
    controller = Controller(GAIT, GEOMETRY, JointGains(), ArmMass(), MotionParameters(fade_in_s=0.5), recovery())
    first = controller.step(TICK_S, Mode.HOLD, states_at(POSE))
    for _ in range(300):
        controller.step(TICK_S, Mode.HOLD, states_at(POSE))
    controller.step(TICK_S, Mode.FAULT, states_at(POSE))
    assert controller.step(TICK_S, Mode.HOLD, states_at(POSE)) == first


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
            controller.step(TICK_S, Mode.WALKING, states_at(FRONT))
        return [controller.step(TICK_S / 20.0, Mode.WALKING, states_at(FRONT)) for _ in range(8000)]

    angles, velocities = gait_only(SPRING), gait_only(DAMPER)
    for before, now, after in zip(angles, velocities[1:], angles[2:], strict=False):
        slopes = [(b - a) / (2.0 * TICK_S / 20.0) for a, b in zip(before, after, strict=True)]
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
    assert ticks * TICK_S == pytest.approx(2.0 * stride_duration_s(GAIT, GEOMETRY, 0.03), abs=TICK_S)


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
    assert poses[-1] == pytest.approx(RAISED)
    sagged = (0.1, -0.1, 0.1, -0.1)
    assert wanted_pose(controller, Mode.HOLD, sagged) == pytest.approx(RAISED)
    assert wanted_pose(controller, Mode.HOLD, sagged) == pytest.approx(RAISED)


def test_a_stop_on_the_way_to_the_front_raises_the_flippers_too() -> None:
    controller = weightless()
    controller.order = WalkOrder(0.03)
    for _ in range(20):
        wanted_pose(controller, Mode.WALKING)
    for _ in range(1000):
        pose = wanted_pose(controller, Mode.STOPPING)
    assert controller.raised
    assert pose == pytest.approx(RAISED)


def test_raised_is_told_only_while_stopping() -> None:
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
