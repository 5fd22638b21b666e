"""Stage 6: strokes in air."""

from experiments.bench.stroke_tracking import FAST_DEG, FAST_RAD_S, SLOW_DEG, SLOW_RAD_S, check_stroke
from tests.bench.staged_bench import StagedBench

MOVES = "all joints go to and fro by 25 and 15 degrees, slowly, then as fast as in a walk."


def test_joints_follow_a_slow_stroke(bench: StagedBench) -> None:
    bench.check(check_stroke, "slow", SLOW_RAD_S, SLOW_DEG)


def test_joints_follow_a_fast_stroke(bench: StagedBench) -> None:
    bench.check(check_stroke, "fast", FAST_RAD_S, FAST_DEG)
