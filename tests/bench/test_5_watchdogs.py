"""Stage 5: commands stop, and the drives must switch off."""

from experiments.bench.watchdog_check import check_watchdog_times, check_what_feeds_watchdogs, proven_watchdogs
from tests.bench.staged_bench import StagedBench

MOVES = "the flippers press down with 0.08 N·m, then commands stop, and every drive must switch off by itself."


def test_drives_switch_off_when_commands_stop(bench: StagedBench) -> None:
    bench.check(check_watchdog_times)


def test_frames_of_other_programs_do_not_feed_the_watchdogs(bench: StagedBench) -> None:
    bench.check(check_what_feeds_watchdogs)
    bench.report.robot["proven_watchdogs"] = proven_watchdogs(bench.test_rig.configuration)
