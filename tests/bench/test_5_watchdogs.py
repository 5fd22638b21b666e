"""Stage 5: this program falls silent, and the drives must let go."""

from experiments.bench.watchdog_check import watchdog_times
from tests.bench.staged_bench import StagedBench

MOVES = "the flippers press down with 0.08 N·m, then commands stop, and every drive must let go by itself."


def test_drives_let_go_when_commands_stop(bench: StagedBench) -> None:
    bench.check(watchdog_times)
