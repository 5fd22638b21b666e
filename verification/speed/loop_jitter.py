"""How punctually the daemon's loop wakes up, compared with the most punctual loop that the same machine allows.

The loop is that of the real daemon, which walks a simulated robot; each is a process of its own, on two local buses.
The bare loop only calls the C library's clock_nanosleep with absolute deadlines. Both run at 380 Hz under the
scheduling that the daemon asks for, in turns of a few seconds up to `--seconds` of each, so both see the same machine;
the simulated robot keeps running next to either. Lateness counts from the first deadline that was due, so a missed
deadline shows as more than a period. Start and first stride of the daemon are outside of every figure. A percentile is
the median of those of the turns.

Loops that only wait take turns with them at 380 and 1,000 Hz: the daemon's ticker, and those of OpenSourceLeg and
loop-rate-limiters (paced_loops.py). `left_out` names those that are not installed: `pip install 'mudskipper[loops]'`
adds them.

Everything runs twice: `held` keeps the processors awake for all loops alike, as the daemon does while torque is on, and
`sleeping` lets them sleep between ticks, for the daemon by `stay_awake = false`. Only figures of the same half may be
compared: next to a loop that holds the processors awake, one that does not would look late.
"""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from control.rate import PERIOD_S, RATE_HZ
from firmware_host.computer.awake_processors import AwakeProcessors
from firmware_host.computer.realtime import prepare_loop
from firmware_host.configuration.loading import load_configuration
from firmware_host.loop_timing import LoopTiming
from verification.local_robot import LONGEST_WAIT_S, LocalRobot
from verification.report import evaluated, run_benchmark, show_progress
from verification.speed.paced_loops import LOOPS, BareTicker, PacedTimes, present_loops

BAR_RATIO = 2.0
TURN_S = 5.0
RATES_HZ = (RATE_HZ, 1000.0)
HALVES = {"held": True, "sleeping": False}
JOINED: dict[str, Callable[[list[float]], float]] = {"p50": median, "p99": median, "max": max}  # over the turns
Report = dict[str, Any]


def time_bare_loop(seconds: float, period_s: float = PERIOD_S) -> Report:
    """Sleeps from deadline to deadline and does nothing else."""
    timing, ticker, until_s = LoopTiming(), BareTicker(period_s), time.monotonic() + seconds
    now_s = 0.0
    while now_s < until_s:
        tick = ticker.wait()
        now_s = tick.now_s
        timing.update(now_s, tick.late_s, tick.missed, 0.0)
    return timing.summary()


def time_daemon(robot: LocalRobot, seconds: float, rate_hz: float = RATE_HZ) -> Report:
    """Returns the daemon's status after that time of walking."""
    daemon = robot.start_daemon(rate_hz)
    robot.require_walk(rate_hz)
    robot.call("reset_timing")
    time.sleep(seconds)
    report: Report = robot.call("status")
    robot.call("disarm")
    daemon.terminate()
    daemon.wait(LONGEST_WAIT_S)
    return report


def summary_of(turns: Sequence[Report]) -> Report:
    totals = {name: sum(turn[name] for turn in turns) for name in ("ticks", "missed_ticks")}
    durations = {
        name: {fraction: join([turn[name][fraction] for turn in turns]) for fraction, join in JOINED.items()}
        for name in ("wake_late_us", "tick_us")
    }
    return totals | durations


class Half:
    """Owns the turns of all loops while the processors are kept awake, or while they may sleep."""

    def __init__(self) -> None:
        self.daemon: list[Report] = []
        self.bare: list[Report] = []
        self.paced = {rate_hz: {name: PacedTimes(1.0 / rate_hz) for name in present_loops()} for rate_hz in RATES_HZ}

    def run_turns(self, robot: LocalRobot, seconds: float) -> None:
        self.daemon.append(time_daemon(robot, seconds))
        self.bare.append(time_bare_loop(seconds))
        for by_name in self.paced.values():
            for name, loop in present_loops().items():
                by_name[name].run(loop, seconds)

    def report(self) -> Report:
        loop, bare = summary_of([report["loop"] for report in self.daemon]), summary_of(self.bare)
        ratios = {
            fraction: round(loop["wake_late_us"][fraction] / max(1.0, bare["wake_late_us"][fraction]), 2)
            for fraction in ("p50", "p99")
        }
        paced = {f"{rate_hz:g}": _paced_report(by_name) for rate_hz, by_name in self.paced.items()}
        return {"loop": loop, "bare": bare, "ratios": ratios, "paced": paced}


def _paced_report(by_name: dict[str, PacedTimes]) -> Report:
    """Return the jitter of each loop, also divided by that of the ticker."""
    reports = {name: times.report() for name, times in by_name.items()}
    own = reports["ticker"]["jitter_us"]
    for report in reports.values():
        jitter_us = report["jitter_us"]
        report["to_ticker"] = {part: round(jitter_us[part] / max(1.0, own[part]), 2) for part in ("p50", "p99")}
    return reports


@contextmanager
def processors_awake(robot: LocalRobot, held: bool) -> Iterator[list[str]]:
    """Keeps the processors awake, or lets them sleep, for the daemon too; yields a warning where that is refused."""
    text = robot.configuration.read_text(encoding="utf-8")
    setting = f"\n[loop]\nstay_awake = {str(held).lower()}\n"
    robot.configuration.write_text(text + setting, encoding="utf-8")
    processors = AwakeProcessors(held)
    processors.update(held)
    try:
        yield [processors.problem] if processors.problem else []
    finally:
        processors.close()
        robot.configuration.write_text(text, encoding="utf-8")


def measure(folder: Path, *, seconds: float = 20.0) -> Report:
    turn_s = min(TURN_S, seconds)
    rounds = max(1, round(seconds / turn_s))
    halves = {name: Half() for name in HALVES}
    robot = LocalRobot(folder)
    try:
        options = load_configuration(robot.configuration).loop
        warnings = prepare_loop(options.priority, options.cpu, options.lock_memory)
        for number in range(rounds):
            for part, (name, held) in enumerate(HALVES.items()):
                show_progress(number + part / len(HALVES), rounds, f"all loops, processors {name}")
                with processors_awake(robot, held) as refused:
                    halves[name].run_turns(robot, turn_s)
                warnings += [each for each in refused if each not in warnings]
    finally:
        robot.end()
    report: Report = {"rounds": rounds, "turn_s": turn_s} | {name: half.report() for name, half in halves.items()}
    daemons = [each for half in halves.values() for each in half.daemon]
    report["left_out"] = sorted(set(LOOPS) - set(present_loops()))
    if report["left_out"]:
        warnings.append(f"without {', '.join(report['left_out'])}: pip install 'mudskipper[loops]'")
    report["warnings"] = warnings
    report["faults"] = sum(each["mode"] != "walking" for each in daemons)
    report["dropped_rows"] = sum(each["log"]["dropped"] for each in daemons)
    bar = f"median lateness at most {BAR_RATIO:g} times the bare loop's, with the processors held awake"
    return evaluated(report, bar, report["held"]["ratios"]["p50"] <= BAR_RATIO)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
