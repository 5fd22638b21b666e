"""Stage 2: encoder zeros, signs and limits. The operator moves the flippers, the motors do not."""

from experiments.bench.rest_pose_check import check_rest_pose
from experiments.calibration.hand_steps import check_hands
from tests.bench.staged_bench import StagedBench


def test_hands_find_every_joint_as_it_is_configured(bench: StagedBench) -> None:
    bench.check(check_hands)


def test_idle_flippers_lie_within_their_limits(bench: StagedBench) -> None:
    bench.check(check_rest_pose)
