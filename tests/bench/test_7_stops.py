"""Stage 7: stops from full speed."""

from experiments.bench.stop_check import damping, soft_stop, torque_off
from tests.bench.staged_bench import StagedBench

MOVES = "strides are stopped at full speed, softly and by braking; at last torque goes off and the flippers fall."


def test_a_soft_stop_ends_a_stride_at_once(bench: StagedBench) -> None:
    bench.check(soft_stop)


def test_damping_brakes_a_fast_sweep(bench: StagedBench) -> None:
    bench.check(damping)


def test_no_current_flows_once_torque_is_off(bench: StagedBench) -> None:
    bench.check(torque_off)
