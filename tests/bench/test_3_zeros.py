"""Stage 3: encoder zeros and limits. The operator moves the flippers, the motors do not."""

import pytest

from control.records import JOINTS
from experiments.bench.joint_zero_check import check_level_pose, check_rest_pose, check_turning
from tests.bench.staged_bench import StagedBench


def test_idle_flippers_lie_within_their_limits(bench: StagedBench) -> None:
    bench.check(check_rest_pose)


def test_flippers_held_level_read_zero(bench: StagedBench) -> None:
    bench.check(check_level_pose)


@pytest.mark.parametrize("joint", JOINTS)
def test_limits_lie_between_the_stops(bench: StagedBench, joint: str) -> None:
    bench.check(check_turning, joint)
