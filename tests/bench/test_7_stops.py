"""Stage 7: stops from full speed."""

from experiments.bench.stop_check import check_damping, check_soft_stop, check_torque_off
from tests.bench.staged_bench import StagedBench

MOVES = "strides are stopped at full speed, softly and by braking; finally torque goes off and the flippers fall."


def test_a_soft_stop_ends_a_stride_at_once(bench: StagedBench) -> None:
    bench.check(check_soft_stop)


def test_damping_brakes_a_fast_sweep(bench: StagedBench) -> None:
    bench.check(check_damping)


def test_no_current_flows_once_torque_is_off(bench: StagedBench) -> None:
    bench.check(check_torque_off)
