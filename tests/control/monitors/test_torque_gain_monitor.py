"""Moments of torque and motion show a wrong gain only where the torque varied and the motion follows it."""

from math import inf, sin

import pytest

from control.faults import Fault
from control.geometry import FlipperGeometry
from control.monitors.torque_gain_monitor import (
    BLOCK_TICKS,
    FACTOR_OF_ONE,
    FACTOR_OF_THREE,
    JOINED_BLOCKS,
    FlipperStrokes,
    JointStrokes,
    Moments,
    Stride,
    TorqueGainMonitor,
    WatchedJoint,
)
from control.parameters.arm_mass import ArmMass
from control.rate import PERIOD_S
from control.records import DriveState, Joints, Phase

INERTIA_KG_M2 = 0.0004


def stride_of(speeds_rad_s: list[float], torques_nm: list[float], fastest_rad_s: float = inf) -> Stride:
    """Return the sums of a stroke: torques of blocks, and the speeds between them."""
    strokes = JointStrokes(WatchedJoint("left_sweep", fastest_rad_s=fastest_rad_s), INERTIA_KG_M2, JOINED_BLOCKS)
    states = [DriveState(0.0, each, 1.0 + n * BLOCK_TICKS * PERIOD_S) for n, each in enumerate(speeds_rad_s)]
    for before, after, torque_nm in zip(states, states[1:], torques_nm, strict=False):
        strokes.add(before, after, torque_nm, 0.0)
    strokes.end_stroke()
    return strokes.end_stride()


@pytest.mark.parametrize("uu", [0.0, -1e-17, 1e-17])
def test_a_torque_that_stays_at_its_limit_shows_no_gain(uu: float) -> None:
    """A joint that lies at its stop: the sums about the mean are the rounding of floats, of either sign."""
    assert not Moments(blocks=9, uu=uu, um=1e-17, mm=0.1).is_line
    assert not Moments(blocks=9, uu=uu, um=1e-17, mm=1e-18).is_line


@pytest.mark.parametrize(("torque_step_nm", "is_wrong"), [(0.0, True), (0.017, True), (0.019, False)])
def test_a_torque_that_changes_by_less_than_a_step_of_its_code_shows_no_gain(
    torque_step_nm: float, is_wrong: bool
) -> None:
    """Of an AK80-64, whose steps of 0.07 N·m are as large as the torque of a whole insertion."""
    moments = Moments(blocks=9, uu=0.0032, um=0.00053, mm=0.00013)
    assert (Stride(moments, moments, moments).gain_beyond(FACTOR_OF_ONE, torque_step_nm) is not None) == is_wrong


def test_a_motion_whose_square_underflows_raises_nothing() -> None:
    moments = Moments(blocks=9, uu=1e-6, um=1e-170, mm=1e-320)
    assert Stride(moments, moments, moments).gain_beyond(FACTOR_OF_ONE) == pytest.approx(0.0)


@pytest.mark.parametrize("gain", [0.3, 3.0])
def test_a_wrong_gain_is_returned(gain: float) -> None:
    moments = Moments(9, 0.1, gain * 0.1, gain * gain * 0.1)
    assert Stride(moments, moments, moments).gain_beyond(FACTOR_OF_ONE) == pytest.approx(gain)


def test_a_joint_that_the_mud_lets_go_of_shows_no_gain_while_it_is_faster_than_any_path() -> None:
    """Measured in a simulated walk with play in its belts: the rotor turns alone while the torque rises."""
    fast = stride_of([-22.31, -13.98, -2.12, 1.4, 1.4, 1.4, 1.4, 1.4, 1.4, 1.4], [0.1627, 0.5278, 0.3643, *[0.0] * 6])
    assert fast.gain_beyond(FACTOR_OF_ONE) is None


@pytest.mark.parametrize(("fastest_rad_s", "is_weak"), [(inf, True), (9.0, False), (7.2, False)])
def test_a_motor_that_has_used_up_its_voltage_shows_no_gain(fastest_rad_s: float, is_weak: bool) -> None:
    """Of a DM4340P, whose speeds end at 10 rad/s: the mud throws the sweep, and full torque drives it no further."""
    speeds_rad_s = [-9.97, -9.97, -9.97, -9.97, -4.09, 7.63, 6.83, 2.18, 1.27, 2.84, 3.56, 3.36, 2.88]
    torques_nm = [-0.6, -0.6, -0.501, 0.25, 0.421, -0.034, -0.159, -0.028, 0.063, 0.032, -0.002, -0.014]
    thrown = stride_of(speeds_rad_s, torques_nm, fastest_rad_s)
    assert (thrown.gain_beyond(FACTOR_OF_ONE) is not None) == is_weak


@pytest.mark.parametrize(("gain", "is_wrong"), [(1.0, False), (2.5, True)])
def test_a_rotor_that_crosses_the_play_of_its_belt_is_no_strong_motor(gain: float, is_wrong: bool) -> None:
    """Measured in a simulated swing with 1 degree of play: three blocks alone, one hit, then both together."""
    crossing = [1.29, 0.53, 0.34, 0.94, 1.52, 1.6, 0.97, 1.42]
    together = [1.52, 1.44, 1.41, 1.36, 1.36, 1.39, 1.42, 1.42, 1.41, 1.39, 1.33, 1.42, 1.41, 1.42, 1.33, 1.38, 1.41]
    torques_mnm = [-8.7, -3.1, 9.8, 8.6, 0.4, -4.2, 14.4, 7.5, 0.4, 1.4, 1.7, 3.0]
    torques_mnm += [3.2, 3.1, 2.1, 3.2, 3.3, 1.5, 4.5, 2.8, 3.5, 0.2, 3.2, 3.5]
    stride = stride_of(crossing + together, [each / gain / 1e3 for each in torques_mnm])
    assert (stride.gain_beyond(FACTOR_OF_ONE) is not None) == is_wrong


@pytest.mark.parametrize(("gain", "is_wrong"), [(1.0, False), (2.5, True)])
def test_a_rotor_that_brakes_alone_at_the_end_of_a_swing_is_no_strong_motor(gain: float, is_wrong: bool) -> None:
    """Measured in another swing: the rotor is at rest before it has crossed the play."""
    speeds = [1.17, 1.58, 1.57, 1.48, 1.32, 1.39, 1.32, 1.39, 1.42, 1.44, 1.35, 1.37, 1.44, 1.35, 1.37, 1.38, 1.45]
    speeds += [1.37, 1.38, 1.39, 1.43, 1.4, 1.36, 1.4, 1.36, 1.4, 1.4, 1.42, 1.34, 1.37, 1.42, 1.4, 0.96, 0.45]
    torques_mnm = [20.3, 7.1, 3.4, 3.4, 6.7, 5.9, 10.2, 8.6, 7.7, 4.9, 6.8, 10.1, 5.3, 7.0, 8.6, 10.2]
    torques_mnm += [5.7, 7.0, 8.0, 9.3, 7.4, 7.0, 7.9, 6.4, 9.7, 7.7, 8.0, 5.6, 7.7, 10.0, 7.2, -1.8, -2.6]
    stride = stride_of(speeds, [each / gain / 1e3 for each in torques_mnm])
    assert (stride.gain_beyond(FACTOR_OF_THREE) is not None) == is_wrong


def test_a_line_through_joined_blocks_that_hardly_vary_is_chance() -> None:
    """Bounds of a simulated swing without play: 1.24 and 1.29 from single blocks, 2.03 and 2.80 from joined ones."""
    blocks = Moments(blocks=73, uu=1e-3, um=1.24e-3, mm=1.6e-3)
    joined = Moments(blocks=23, uu=1e-5, um=2.03e-5, mm=5.68e-5)
    assert joined.is_line and Stride(blocks, joined).gain_beyond(FACTOR_OF_ONE) is None


@pytest.mark.parametrize(("thrown", "gain", "is_wrong"), [(True, 1.0, False), (False, 1.0, False), (False, 0.4, True)])
def test_a_thrown_sweep_that_the_mud_still_pushes_while_it_is_braked_is_no_weak_motor(
    thrown: bool, gain: float, is_wrong: bool
) -> None:
    """Torque and motion in mN·m of simulated swings of a body that has sunk; without most of their plateau."""
    pushed = [(-168.5, -46.0), (-83.5, -16.1), (-22.8, 13.9), (3.0, 10.6), (16.6, -0.1), (41.2, 3.0), (55.2, 4.1)]
    driven = [(73.8, 25.8), (66.7, 18.2), (47.9, -2.1)]
    plateau = [
        (63.5, 7.1),
        (59.6, 10.1),
        (48.0, -1.4),
        (50.1, 0.6),
        (52.0, 2.9),
        (53.5, 3.6),
        (54.1, 5.0),
        (49.0, -0.6),
    ]
    braking = [
        (52.5, 2.6),
        (52.9, 4.2),
        (54.8, 5.8),
        (48.9, -0.7),
        (49.8, 0.1),
        (50.2, 0.6),
        (36.6, -12.2),
        (29.6, -20.7),
    ]
    blocks = (pushed if thrown else driven) + plateau + braking
    speeds = [5.0]
    for _, motion_mnm in blocks:
        speeds.append(speeds[-1] + motion_mnm / 1e3 / INERTIA_KG_M2 * BLOCK_TICKS * PERIOD_S)
    stride = stride_of(speeds, [torque_mnm / gain / 1e3 for torque_mnm, _ in blocks])
    assert (stride.gain_beyond(FACTOR_OF_ONE) is not None) == is_wrong


def test_a_stroke_that_is_too_short_to_cross_a_play_counts_for_a_weak_motor_only() -> None:
    stride = stride_of([1.0, 1.2, 1.4, 1.6, 1.8, 2.0], [0.01] * 5)
    assert (stride.blocks.blocks, stride.joined.blocks) == (5, 0)


def monitor_of(*asked: bool) -> TorqueGainMonitor:
    """Return the monitor of a flipper without weight and friction."""
    weightless = ArmMass(arm_mass_kg=0.0, sweep_inertia_kg_m2=INERTIA_KG_M2, adduction_inertia_kg_m2=INERTIA_KG_M2)
    joints = [WatchedJoint(name, answers_only=each) for name, each in zip(("sweep", "adduction"), asked, strict=True)]
    return TorqueGainMonitor([FlipperStrokes(0, joints, FlipperGeometry(), weightless)])


@pytest.mark.parametrize("asked", [(False, False), (False, True), (True, False), (True, True)])
def test_each_joint_of_a_flipper_has_the_commands_of_its_own_type_of_drive(asked: tuple[bool, bool]) -> None:
    """A torque that reverses with every block has half the mean over four ticks from the one before on."""
    monitor, found = monitor_of(*asked), list[Fault]()
    stamp_s, speeds_rad_s, delayed = 1.0, [1.0, 1.0], [0.0, 0.0]
    for phase in (Phase.SWING, Phase.INSERTION, Phase.STANCE):
        for tick in range(40):
            torque_nm = 0.02 if (tick - 1) // 4 % 2 else -0.02
            stamp_s += PERIOD_S
            for joint, is_asked in enumerate(asked):
                acting_nm, delayed[joint] = (delayed[joint], torque_nm) if is_asked else (torque_nm, torque_nm)
                speeds_rad_s[joint] += 1.2 * acting_nm / INERTIA_KG_M2 * PERIOD_S
            sweep, adduction = (DriveState(0.5, speed_rad_s, stamp_s) for speed_rad_s in speeds_rad_s)
            monitor.update(found, True, Joints(sweep, adduction), Joints(torque_nm, torque_nm), phase)
    assert found == []


@pytest.mark.parametrize(
    ("before", "counts"),
    [
        ((Phase.SWING, Phase.PAUSE), True),
        ((Phase.SWING, Phase.REST), False),
        ((Phase.SWING, Phase.INSERTION, Phase.STANCE, Phase.REST), False),
    ],
)
def test_the_first_insertion_of_a_walk_may_be_in_mud_into_which_the_body_has_sunk(
    before: tuple[Phase, ...], counts: bool
) -> None:
    """The swing of the walk before was in air. By its angles the flipper is in air now too, by its torque it is not."""
    monitor, found, stamp_s, speed_rad_s = monitor_of(False, False), list[Fault](), 1.0, 1.0
    for phase, gain in (*((each, 1.0) for each in before), (Phase.INSERTION, 0.2), (Phase.STANCE, 1.0)):
        for tick in range(40):
            torque_nm = 0.02 * sin(tick / 6.0)
            stamp_s, speed_rad_s = stamp_s + PERIOD_S, speed_rad_s + gain * torque_nm / INERTIA_KG_M2 * PERIOD_S
            state = DriveState(0.5, speed_rad_s, stamp_s)
            monitor.update(found, True, Joints(state, state), Joints(torque_nm, torque_nm), phase)
    assert bool(found) == counts
