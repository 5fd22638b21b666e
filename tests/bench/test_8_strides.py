"""Stage 8: a walk in air."""

from experiments.bench.stroke_tracking import strides
from tests.bench.staged_bench import StagedBench

MOVES = "the robot walks ten strides in air."


def test_ten_strides_are_walked_without_fault_or_limit(bench: StagedBench) -> None:
    bench.check(strides)
