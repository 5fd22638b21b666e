"""The stride's timing against the paper's numbers, and its motion against numeric derivatives."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, pairwise
from math import degrees, floor, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.gait.gait import RAMP_S, Gait, smooth_progress
from control.gait.stride_table import stride_duration_s, stride_table
from control.geometry import FlipperGeometry
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.parameters.joint_limits import JointLimits
from control.rate import PERIOD_S
from control.records import GaitTarget, Phase
from firmware_host.configuration.gait_file import PROTOCOLS

GEOMETRY = FlipperGeometry(flipper_length_m=0.12, drop_m=0.05, axis_height_m=0.0645)
WALKING = GaitParameters()
DEPTHS_M = (0.03, 0.05)


def started(depth_m: float = 0.03, parameters: GaitParameters = WALKING) -> Gait:
    gait = Gait(parameters, GEOMETRY)
    gait.reset(depth_m)
    return gait


def targets(depth_m: float) -> Iterator[GaitTarget]:
    gait = started(depth_m)
    while True:
        yield gait.step(PERIOD_S)


def one_stride(depth_m: float) -> list[GaitTarget]:
    count = floor(stride_duration_s(WALKING, GEOMETRY, depth_m) / PERIOD_S - 1e-6)
    return list(islice(targets(depth_m), count))


def adduction_velocity_rad_s(target: GaitTarget) -> float:
    angle = GEOMETRY.adduction_rad(target.sweep_rad, target.depth_m)
    return GEOMETRY.adduction_velocity_rad_s(
        target.sweep_rad, angle, target.sweep_velocity_rad_s, target.depth_velocity_m_s
    )


def test_the_single_flipper_protocol_is_the_papers() -> None:
    rows = stride_table(PROTOCOLS["single_flipper"], GEOMETRY, 0.03)
    assert [row.duration_s for row in rows if row.phase is Phase.PAUSE] == [3.0, 3.0, 3.0]
    for row in rows:
        path_m = abs(row.depth_end_m - row.depth_start_m) + 0.12 * abs(row.sweep_end_rad - row.sweep_start_rad)
        if row.phase is not Phase.PAUSE:
            assert path_m / row.duration_s == pytest.approx(0.1)


@pytest.mark.parametrize(("duration_s", "swing_s"), [(0.8, 0.8), (0.0, 2.0 * pi / 6.0 * 0.12 / 0.25)])
def test_each_phase_lasts_its_path_over_its_speed_and_a_swing_its_duration(duration_s: float, swing_s: float) -> None:
    parameters = GaitParameters(
        insertion_speed_m_s=0.2,
        stance_speed_m_s=0.3,
        extraction_speed_m_s=0.4,
        swing_speed_m_s=0.25,
        swing_duration_s=duration_s,
    )
    durations = [row.duration_s for row in stride_table(parameters, GEOMETRY, 0.04)]
    assert durations == pytest.approx(
        [(0.0145 + 0.04) / 0.2, 2.0 * pi / 6.0 * 0.12 / 0.3, (0.0145 + 0.04) / 0.4, swing_s]
    )


@pytest.mark.parametrize("depth_m", DEPTHS_M)
def test_the_stance_sweeps_at_its_depth_from_plus_to_minus_thirty_degrees(depth_m: float) -> None:
    stance = [target for target in one_stride(depth_m) if target.phase is Phase.STANCE]
    assert {target.depth_m for target in stance} == {depth_m}
    assert {target.depth_velocity_m_s for target in stance} == {0.0}
    assert all(later.sweep_rad < earlier.sweep_rad for earlier, later in pairwise(stance))
    assert stance[0].sweep_rad > radians(29.9)
    assert stance[-1].sweep_rad < radians(-29.9)


def test_the_edge_swings_back_above_the_mud() -> None:
    swing = [target for target in one_stride(0.05) if target.phase is Phase.SWING]
    assert [target.depth_m for target in swing] == pytest.approx([-0.0145] * len(swing))
    assert all(target.sweep_velocity_rad_s > 0.0 for target in swing[1:-1])
    row = stride_table(WALKING, GEOMETRY, 0.03)[-1]
    assert (degrees(row.sweep_start_rad), degrees(row.sweep_end_rad)) == pytest.approx((-30.0, 30.0))


@given(st.floats(0.001, 20.0))
def test_smooth_progress_rests_before_the_start_and_after_the_end(duration: float) -> None:
    assert smooth_progress(-1.0, duration) == (0.0, 0.0)
    assert smooth_progress(0.0, duration) == (0.0, 0.0)
    assert smooth_progress(duration, duration) == (1.0, 0.0)
    assert smooth_progress(duration + 1.0, duration) == (1.0, 0.0)


@given(st.floats(0.01, 20.0), st.floats(0.01, 0.99))
def test_smooth_progress_moves_at_the_rate_that_it_returns(duration: float, fraction: float) -> None:
    time, step = fraction * duration, 1e-5 * duration
    difference = smooth_progress(time + step, duration)[0] - smooth_progress(time - step, duration)[0]
    _, rate = smooth_progress(time, duration)
    assert difference / (2.0 * step) == pytest.approx(rate, rel=1e-4, abs=1e-4 / duration)
    assert rate <= 1.0 / (duration - min(RAMP_S, duration / 2.0)) * (1.0 + 1e-12)


@pytest.mark.parametrize("depth_m", DEPTHS_M)
def test_no_joint_accelerates_between_ticks_harder_than_its_torque_limit_allows_in_air(depth_m: float) -> None:
    stride = list(islice(targets(depth_m), 2000))
    arm, torque_nm = ArmMass(), JointLimits().torque_nm
    for now, after in pairwise(stride):
        sweep_change = after.sweep_velocity_rad_s - now.sweep_velocity_rad_s
        adduction_change = adduction_velocity_rad_s(after) - adduction_velocity_rad_s(now)
        assert abs(sweep_change) / PERIOD_S * arm.sweep_inertia_kg_m2 < torque_nm
        assert abs(adduction_change) / PERIOD_S * arm.adduction_inertia_kg_m2 < torque_nm


@pytest.mark.parametrize("depth_m", DEPTHS_M)
def test_a_hundred_strides_keep_their_exact_rate(depth_m: float) -> None:
    quick = GaitParameters(insertion_speed_m_s=1.0, swing_duration_s=0.1)
    duration = stride_duration_s(quick, GEOMETRY, depth_m)
    ticks = round(100.4 * duration / PERIOD_S)
    gait = started(depth_m, quick)
    for _ in range(ticks):
        target = gait.step(PERIOD_S)
    expected = started(depth_m, quick).step(ticks * PERIOD_S - 100 * duration)
    assert (target.stride, target.phase) == (100, expected.phase)
    assert target[2:] == pytest.approx(expected[2:], abs=1e-6)


def test_a_new_depth_waits_for_the_next_stride() -> None:
    gait = started(0.03)
    depths: dict[int, float] = {}
    for tick in range(1000):
        target = gait.step(PERIOD_S)
        if tick == 100:
            gait.next_depth_m = 0.045
        if target.phase is Phase.STANCE:
            depths[target.stride] = target.depth_m
            assert gait.commanded_depth_m == target.depth_m
    assert depths == {0: 0.03, 1: 0.045}


@pytest.mark.parametrize("parameters", PROTOCOLS.values())
def test_a_swing_that_may_not_begin_is_waited_for_at_the_rear_and_up(parameters: GaitParameters) -> None:
    gait = started(0.03, parameters)
    before_swing_s = stride_duration_s(parameters, GEOMETRY, 0.03) - stride_table(parameters, GEOMETRY, 0.03)[-1][1]
    for _ in range(round((before_swing_s + 2.0) / PERIOD_S)):
        target = gait.step(PERIOD_S, may_swing=False)
    assert gait.waits
    assert target.phase in (Phase.EXTRACTION, Phase.PAUSE)
    assert target[2:] == pytest.approx((radians(-30.0), 0.0, -GEOMETRY.clearance_m, 0.0))
    assert gait.step(PERIOD_S).phase is Phase.SWING
    assert not gait.waits


def test_a_swing_that_may_not_begin_hinders_nothing_before_it() -> None:
    free, held = started(), started()
    while (target := free.step(PERIOD_S)).phase is not Phase.SWING:
        assert held.step(PERIOD_S, may_swing=False) == target


def test_a_reset_starts_the_first_stride_of_the_configured_gait_again() -> None:
    gait = started()
    first = [gait.step(PERIOD_S) for _ in range(1500)]
    gait.next_depth_m, gait.next_parameters = 0.045, WIDE
    for _ in range(1500):
        gait.step(PERIOD_S)
    gait.next_depth_m = 0.045
    gait.reset(0.03)
    assert [gait.step(PERIOD_S) for _ in range(1500)] == first


WIDE = replace(WALKING, sweep_angle_deg=45.0, swing_duration_s=0.3)
NARROW = replace(WALKING, sweep_angle_deg=20.0)


def swept(changes: dict[float, GaitParameters], duration_s: float) -> list[GaitTarget]:
    """Return the targets of a walk whose next gait is set at the first tick at or after each given fraction of the
    swing.
    """
    gait, seen, waiting, swing_ticks, dt_s = started(), list[GaitTarget](), dict(changes), 0, 0.0005
    for _ in range(round(duration_s / dt_s)):
        if seen and seen[-1].phase is Phase.SWING and seen[-1].stride == 0:
            swing_ticks += 1
            for fraction in [each for each in waiting if swing_ticks * dt_s >= each * WALKING.swing_duration_s]:
                gait.next_parameters = waiting.pop(fraction)
        seen.append(gait.step(dt_s))
    return seen


STRIDE_S = stride_duration_s(WALKING, GEOMETRY, 0.03)


@pytest.mark.parametrize("change", [{0.0: WIDE}, {0.0: NARROW}, {0.3: WIDE}, {0.1: WIDE, 0.4: NARROW}])
def test_another_sweep_set_in_swing_moves_the_target_without_a_jump(change: dict[float, GaitParameters]) -> None:
    seen = swept(change, STRIDE_S + 0.8)
    for before, after in pairwise(seen):
        mean_rad_s = (before.sweep_velocity_rad_s + after.sweep_velocity_rad_s) / 2.0
        moved_rad = after.sweep_rad - before.sweep_rad
        # The trapezium's error over a step of 0.5 ms is dt² Δa/8 at a bend; accelerations stay below 1000 rad/s².
        assert moved_rad == pytest.approx(mean_rad_s * 0.0005, abs=3e-5)
        assert abs(after.sweep_velocity_rad_s - before.sweep_velocity_rad_s) < 1000.0 * 0.0005


@pytest.mark.parametrize("last", [WIDE, NARROW])
def test_the_stride_after_a_change_sweeps_from_its_own_front_to_its_own_rear(last: GaitParameters) -> None:
    seen = [target for target in swept({0.0: last}, STRIDE_S + 1.2) if target.stride == 1]
    for phase, sign in ((Phase.INSERTION, 1.0), (Phase.EXTRACTION, -1.0)):
        sweeps = [target.sweep_rad for target in seen if target.phase is phase]
        assert sweeps and sweeps == pytest.approx([sign * radians(last.sweep_angle_deg)] * len(sweeps))


def test_the_swing_of_a_stride_has_the_duration_of_its_own_gait() -> None:
    seen = swept({0.0: WIDE}, 2.0 * STRIDE_S + 0.2)
    assert [
        sum(target.phase is Phase.SWING and target.stride == stride for target in seen) * 0.0005 for stride in (0, 1)
    ] == pytest.approx([0.8, 0.3], abs=0.001)


def test_a_gait_set_late_in_the_swing_is_that_of_the_stride_after_the_next() -> None:
    seen = swept({0.6: WIDE}, 2.0 * STRIDE_S + 0.5)
    fronts = [next(t.sweep_rad for t in seen if t.stride == i and t.phase is Phase.INSERTION) for i in (1, 2)]
    assert fronts == pytest.approx([radians(30.0), radians(45.0)])


def test_an_insertion_that_ends_early_leaves_the_rest_of_the_stride_at_its_depth() -> None:
    gait = started(0.05)
    before = gait.step(0.4)
    gait.end_phase()
    after = gait.step(0.0)
    assert (before.phase, after.phase) == (Phase.INSERTION, Phase.STANCE)
    assert after.depth_m == gait.commanded_depth_m == before.depth_m < 0.03
    assert after.sweep_rad == before.sweep_rad
    stance = [target for target in (gait.step(0.01) for _ in range(20)) if target.phase is Phase.STANCE]
    assert {target.depth_m for target in stance} == {before.depth_m}


def test_only_an_insertion_in_the_mud_can_end_early_and_only_that_of_its_own_stride() -> None:
    for until_s, phase in ((0.05, Phase.INSERTION), (0.5, Phase.STANCE)):
        gait = started()
        gait.step(until_s)
        assert not gait.end_phase()
        assert (gait.step(0.0).phase, gait.commanded_depth_m) == (phase, 0.03)
    gait.reset(0.03)
    gait.step(0.3)
    gait.end_phase()
    while gait.stride == 0:
        gait.step(0.01)
    assert gait.commanded_depth_m == 0.03


def test_a_depth_meant_for_a_narrower_sweep_that_was_set_late_stays_within_reach() -> None:
    gait = Gait(replace(WALKING, sweep_angle_deg=50.0), GEOMETRY)
    gait.reset(0.02)
    while (target := gait.step(PERIOD_S)).stride == 0:
        late = target.phase is Phase.SWING and target.sweep_rad > 0.5
        if late:
            gait.next_depth_m, gait.next_parameters = 0.05, WALKING
    assert gait.commanded_depth_m == GEOMETRY.deepest_m(50.0)
    while gait.step(PERIOD_S).stride == 1:
        pass
    assert gait.commanded_depth_m == 0.05


@pytest.mark.parametrize("turns", [False, True])
def test_a_choice_is_due_before_a_stride_uses_it(turns: bool) -> None:
    """It is due in the last ticks of a swing and, if the gait turns, in the last ticks of its first half."""
    gait, due_s, swing_s, begun_s, now_s = started(), list[float](), WALKING.swing_duration_s, 0.0, 0.0
    while gait.stride == 0:
        phase = gait.step(PERIOD_S).phase
        now_s += PERIOD_S
        begun_s = begun_s if phase is Phase.SWING else now_s
        if gait.is_choice_due(3.0 * PERIOD_S, turns):
            assert phase is Phase.SWING
            due_s.append(now_s - begun_s)
    assert len(due_s) == (3 + 3 * turns)
    assert due_s[-1] == pytest.approx(swing_s, abs=2.0 * PERIOD_S)
    assert due_s[0] == pytest.approx(swing_s / 2.0 if turns else swing_s, abs=5.0 * PERIOD_S)
