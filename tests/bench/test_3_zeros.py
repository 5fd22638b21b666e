"""Stage 3: encoder zeros and limits. Hands move the flippers, motors do not."""

import pytest

from control.records import JOINTS
from experiments.bench.joint_zero_check import level_pose, rest_pose, turned
from tests.bench.staged_bench import StagedBench


def test_idle_flippers_lie_where_they_can_lie(bench: StagedBench) -> None:
    bench.check(rest_pose)


def test_flippers_held_level_read_zero(bench: StagedBench) -> None:
    bench.check(level_pose)


@pytest.mark.parametrize("joint", JOINTS)
def test_limits_lie_between_the_stops(bench: StagedBench, joint: str) -> None:
    bench.check(turned, joint)
