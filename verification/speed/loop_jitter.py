"""How punctually the daemon's loop wakes up, compared with the most punctual loop that the same machine allows.

The loop is that of the real daemon, which walks a simulated robot; each is a process of its own, on two local buses.
The bare loop only calls the C library's clock_nanosleep with absolute deadlines. Both run under the scheduling that the
daemon asks for, in turns of a few seconds up to `--seconds` of each, while the simulated robot keeps running. Lateness
counts from the first deadline that was due; a tick is missed when it begins a whole period late or more. Start and
first stride of the daemon are outside of every figure. A percentile is the median of those of the turns.

Everything runs twice: `held` keeps the processors awake for both loops alike, as the daemon does while torque is on,
and `sleeping` lets them sleep between ticks, for the daemon by `stay_awake = false`. `--rate-hz` replaces the rate of
380 Hz in both loops; robot and messages keep their own. `compiled` says which form of the tick ran.
"""

import ctypes
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median

from control.rate import RATE_HZ
from firmware_host.computer.awake_processors import AwakeProcessors
from firmware_host.computer.realtime import prepare_loop
from firmware_host.configuration.loading import load_configuration
from firmware_host.loop_timing import LoopTiming
from firmware_host.software_version import is_compiled
from verification.benchmark import Report, evaluated, measure_in_turns, paired_ratio, run_benchmark
from verification.local_robot import LONGEST_WAIT_S, LocalRobot

BAR_RATIO = 2.0
TURN_S = 5.0
TIMER_ABSTIME = 1


class Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


def time_bare_loop(seconds: float, period_s: float) -> Report:
    """Sleep from deadline to deadline by the C library and do nothing else."""
    timing, until, sleep = LoopTiming(), Timespec(), ctypes.CDLL(None).clock_nanosleep
    start_s = now_s = time.monotonic()
    number = 0
    while now_s < start_s + seconds:
        number += 1
        deadline_s = start_s + number * period_s
        until.seconds, until.nanoseconds = int(deadline_s), int(deadline_s % 1.0 * 1e9)
        sleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, ctypes.byref(until), None)
        now_s = time.monotonic()
        missed = int((now_s - deadline_s) / period_s)
        number += missed
        timing.update(now_s, now_s - deadline_s, missed, 0.0)
    return timing.summary()


def time_daemon(robot: LocalRobot, seconds: float, rate_hz: float) -> Report:
    """Return the loop's timing over that time of walking."""
    daemon = robot.start_daemon(rate_hz)
    robot.require_walk(rate_hz)
    robot.call("reset_timing")
    time.sleep(seconds)
    report: Report = robot.call("status")
    robot.call("disarm")
    daemon.terminate()
    daemon.wait(LONGEST_WAIT_S)
    timing: Report = report["loop"]
    return timing | {"fault": report["mode"] != "walking", "dropped": report["log"]["dropped"]}


def summary_of(turns: Sequence[Report]) -> Report:
    ticks, missed = (sum(turn[name] for turn in turns) for name in ("ticks", "missed_ticks"))
    medians_us = {
        name: {part: median(turn[name][part] for turn in turns) for part in ("p50", "p99")}
        for name in ("wake_late_us", "tick_us")
    }
    return {"ticks": ticks, "missed_ticks": missed, "missed_fraction": missed / max(1, ticks + missed)} | medians_us


@contextmanager
def processors_awake(robot: LocalRobot, held: bool) -> Iterator[list[str]]:
    """Keep the processors awake, or let them sleep, for the daemon too; yield a warning where that is refused."""
    text = robot.configuration.read_text(encoding="utf-8")
    setting = f"[loop]\nstay_awake = {str(held).lower()}\n"
    robot.configuration.write_text(text.replace("[loop]\n", setting), encoding="utf-8")
    processors = AwakeProcessors(held)
    processors.update(held)
    try:
        yield [processors.problem] if processors.problem else []
    finally:
        processors.close()
        robot.configuration.write_text(text, encoding="utf-8")


def measure_half(robot: LocalRobot, turn_s: float, rate_hz: float, rounds: int) -> Report:
    """Return the ticks of the daemon and of the bare loop, and the ratio of their lateness."""
    turns = {
        "loop": partial(time_daemon, robot, turn_s, rate_hz),
        "bare": partial(time_bare_loop, turn_s, 1.0 / rate_hz),
    }
    measured = measure_in_turns(turns, rounds)
    ratios = {}
    for fraction in ("p50", "p99"):
        late_us = {name: [max(1.0, turn["wake_late_us"][fraction]) for turn in each] for name, each in measured.items()}
        ratios[fraction] = paired_ratio(late_us["loop"], late_us["bare"])
    faults, dropped = (sum(turn[name] for turn in measured["loop"]) for name in ("fault", "dropped"))
    summaries = {name: summary_of(each) for name, each in measured.items()}
    return summaries | {"ratios": ratios, "faults": faults, "dropped_rows": dropped}


def measure(folder: Path, *, seconds: float = 20.0, rate_hz: float = RATE_HZ) -> Report:
    turn_s = min(TURN_S, seconds)
    rounds = max(1, round(seconds / turn_s))
    robot, report = LocalRobot(folder), Report()
    try:
        options = load_configuration(robot.configuration).loop
        warnings = prepare_loop(options.priority, options.cpu, options.lock_memory)
        for name, held in (("held", True), ("sleeping", False)):
            with processors_awake(robot, held) as refused:
                report[name] = measure_half(robot, turn_s, rate_hz, rounds)
            warnings += [each for each in refused if each not in warnings]
    finally:
        robot.end()
    report |= {"rate_hz": rate_hz, "rounds": rounds, "turn_s": turn_s, "compiled": is_compiled(), "warnings": warnings}
    bar = f"median lateness at most {BAR_RATIO:g} times the bare loop's, with the processors held awake"
    return evaluated(report, bar, report["held"]["ratios"]["p50"]["ratio"] <= BAR_RATIO)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
