"""Stage 8: a walk in air."""

from experiments.bench.stroke_tracking import check_strides
from tests.bench.staged_bench import StagedBench

MOVES = "the robot walks ten strides in air."


def test_the_robot_walks_ten_strides_without_a_fault_or_a_limit(bench: StagedBench) -> None:
    bench.check(check_strides)
