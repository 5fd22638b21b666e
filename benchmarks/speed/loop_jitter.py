"""How punctually the daemon's loop wakes up, compared with the most punctual loop that the same machine allows.

The loop is that of the real daemon, which walks a simulated robot; each is a process of its own, on two local buses.
The bare loop only calls the C library's clock_nanosleep with absolute deadlines. Both run at 380 Hz under the
scheduling that the daemon asks for, in turns of a few seconds up to `--seconds` of each, so both see the same machine;
the simulated robot keeps running next to either. Lateness counts from the first deadline that was due, so a missed
deadline shows as more than a period. Start and first stride of the daemon are outside of every figure. A percentile is
the median of those of the turns.
"""

import ctypes
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.local_robot import LONGEST_WAIT_S, LocalRobot
from benchmarks.report import evaluated, run_benchmark, show_progress
from control.rate import PERIOD_S
from firmware_host.computer.realtime import prepare_loop
from firmware_host.configuration.loading import load_configuration
from firmware_host.loop_timing import LoopTiming

BAR_RATIO = 2.0
TURN_S = 5.0
TIMER_ABSTIME = 1
JOINED: dict[str, Callable[[list[float]], float]] = {"p50": median, "p99": median, "max": max}  # over the turns


class Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


def time_bare_loop(seconds: float) -> dict[str, Any]:
    """Sleeps from deadline to deadline and does nothing else."""
    timing, until, sleep = LoopTiming(), Timespec(), ctypes.CDLL(None).clock_nanosleep
    start_s, number, last = time.monotonic(), 0, round(seconds / PERIOD_S)
    while number < last:
        number += 1
        deadline_s = start_s + number * PERIOD_S
        until.seconds, until.nanoseconds = int(deadline_s), int(deadline_s % 1.0 * 1e9)
        sleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, ctypes.byref(until), None)
        now_s = time.monotonic()
        missed = int((now_s - deadline_s) / PERIOD_S)
        number += missed
        timing.update(now_s, now_s - deadline_s, missed, 0.0)
    return timing.summary()


def time_daemon(robot: LocalRobot, seconds: float) -> dict[str, Any]:
    """Returns the daemon's status after that time of walking. Raises RuntimeError where the robot does not walk."""
    daemon = robot.start_daemon()
    if not robot.walk_until("stance"):
        raise RuntimeError(f"the simulated robot does not walk: {robot.call('status')['fault']}")
    robot.call("reset_timing")
    time.sleep(seconds)
    report: dict[str, Any] = robot.call("status")
    robot.call("disarm")
    daemon.terminate()
    daemon.wait(LONGEST_WAIT_S)
    return report


def summary_of(turns: Sequence[dict[str, Any]]) -> dict[str, Any]:
    totals = {name: sum(turn[name] for turn in turns) for name in ("ticks", "missed_ticks")}
    durations = {
        name: {fraction: join([turn[name][fraction] for turn in turns]) for fraction, join in JOINED.items()}
        for name in ("wake_late_us", "tick_us")
    }
    return totals | durations


def measure(folder: Path, *, seconds: float = 30.0) -> dict[str, Any]:
    turn_s = min(TURN_S, seconds)
    rounds = max(1, round(seconds / turn_s))
    reports, bare_turns = [], []
    robot = LocalRobot(folder)
    try:
        options = load_configuration(robot.configuration).loop
        warnings = prepare_loop(options.priority, options.cpu, options.lock_memory)
        for number in range(rounds):
            show_progress(number, rounds, "the daemon's loop")
            reports.append(time_daemon(robot, turn_s))
            show_progress(number + 0.7, rounds, "the bare loop")
            bare_turns.append(time_bare_loop(turn_s))
    finally:
        robot.end()
    loop, bare = summary_of([report["loop"] for report in reports]), summary_of(bare_turns)
    ratios = {
        fraction: round(loop["wake_late_us"][fraction] / max(1.0, bare["wake_late_us"][fraction]), 2)
        for fraction in ("p50", "p99")
    }
    report = {"rounds": rounds, "turn_s": turn_s, "loop": loop, "bare": bare, "ratios": ratios, "warnings": warnings}
    report["faults"] = sum(each["mode"] != "walking" for each in reports)
    report["dropped_rows"] = sum(each["log"]["dropped"] for each in reports)
    bar = f"median lateness at most {BAR_RATIO:g} times the bare loop's"
    return evaluated(report, bar, ratios["p50"] <= BAR_RATIO)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
