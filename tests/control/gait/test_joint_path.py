"""Paths between poses: where they start, where they end and how fast they go."""

from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from control.gait.joint_path import SHORTEST_LEG_S, JointPath, still
from control.rate import PERIOD_S
from control.records import JointAngles, Joints, JointTargets

angles = st.floats(-1.5, 1.5)
poses = st.builds(Joints, angles, angles, angles, angles)
speeds = st.floats(0.5, 10.0)


def walked(path: JointPath) -> list[JointTargets]:
    steps = []
    while not path.finished:
        steps.append(path.step(PERIOD_S))
        assert len(steps) < 10_000
    return steps


def angles_of(targets: JointTargets) -> JointAngles:
    return targets.map(lambda target: target.angle_rad)


@given(poses, st.lists(poses, min_size=1, max_size=3), speeds)
def test_a_path_leads_to_its_last_point_in_its_longest_legs_over_the_speed_and_stays_there(
    start: JointAngles, way_points: list[JointAngles], speed: float
) -> None:
    path = JointPath(start, way_points, speed)
    assert angles_of(path.step(0.0)) == start
    steps = walked(path)
    assert {steps[-1], *(path.step(PERIOD_S) for _ in range(50))} == {still(way_points[-1])}
    assert path.finished
    legs_rad = [max(abs(b - a) for a, b in zip(p, q, strict=True)) for p, q in pairwise([start, *way_points])]
    duration = sum(max(SHORTEST_LEG_S, leg_rad / speed) for leg_rad in legs_rad)
    assert len(steps) * PERIOD_S == pytest.approx(duration, abs=1.01 * PERIOD_S)
    for before, after in pairwise([still(start), *steps]):
        assert all(abs(joint.velocity_rad_s) <= 2.0 * speed * (1.0 + 1e-9) for joint in after)
        moved = [abs(b - a) for a, b in zip(angles_of(before), angles_of(after), strict=True)]
        assert max(moved) <= 2.0 * speed * PERIOD_S * (1.0 + 1e-9)


def test_way_points_are_passed_one_after_the_other() -> None:
    raised, front = Joints(0.4, 0.0, 0.4, 0.0), Joints(0.5, 0.0, 0.5, 0.0)
    steps = walked(JointPath(Joints(0.4, -0.6, 0.4, -0.6), [raised, front], 1.0))
    lifting = [step for step in steps if step[0].angle_rad == 0.4]
    sweeping = [step for step in steps if step[0].angle_rad > 0.4]
    assert steps == lifting + sweeping
    assert all(step[1].angle_rad < 0.0 for step in lifting[:-1])
    assert all(step[1].angle_rad == 0.0 for step in sweeping)


@given(poses, poses, speeds, st.floats(-1.0, 1.0))
@example(Joints(0.0, 0.625, 0.0, 0.0), Joints(0.0, 1.125, 0.0, 0.0), 5.0, -1.0)
def test_joints_that_move_go_on_without_a_jump_and_still_end_at_rest(
    start: JointAngles, end: JointAngles, speed: float, fraction: float
) -> None:
    begun_rad_s = [fraction * speed] * 4
    steps = walked(JointPath(start, [end], speed, begun_rad_s))
    assert steps[-1] == still(end)
    assert [target.velocity_rad_s for target in steps[0]] == pytest.approx(begun_rad_s, abs=0.2 * speed)
    for before, after in pairwise(steps):
        for here, there in zip(before, after, strict=True):
            # of a leg of two ramps that begins at full speed backwards: the largest 1 - cos(2 π s) + (1 - s) (3 s - 1)
            assert abs(there.velocity_rad_s) <= 2.2611 * speed
            mean_rad_s = (here.velocity_rad_s + there.velocity_rad_s) / 2.0
            assert (there.angle_rad - here.angle_rad) / PERIOD_S == pytest.approx(mean_rad_s, abs=0.2 * speed)


def test_a_path_without_points_is_finished_at_once() -> None:
    path = JointPath(Joints(0.1, 0.2, 0.3, 0.4), [], 1.0)
    assert path.finished
    assert path.step(PERIOD_S) == still(Joints(0.1, 0.2, 0.3, 0.4))
