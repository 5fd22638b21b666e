"""How punctually the daemon's loop wakes up, compared with the most punctual loop that the same machine allows.

The loop is the daemon's own body: ticker, whole tick over two local buses, recorder and status socket, while it
walks a simulated robot that lives in a process of its own. The bare loop only calls the C library's clock_nanosleep
with absolute deadlines. Both run at 380 Hz in this process, under the scheduling that the daemon asks for, in turns
of a few seconds, so both see the same machine; the simulated robot keeps running next to either. Lateness counts
from the first deadline that was due, so a missed deadline shows as more than a period. Before each turn of the loop
the robot is armed and led to its first stride, outside of every figure.
"""

from __future__ import annotations

import argparse
import ctypes
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from benchmarks.local_robot import LocalRobot
from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from control.controller import WalkOrder
from control.modes import Mode, Request
from control.rate import PERIOD_S
from drivers.drive_types import make_drives
from drivers.pose.pose_port import PosePort
from firmware_host.buses import open_ports
from firmware_host.computer.realtime import prepare_loop
from firmware_host.computer.sd_notify import SystemdNotifier
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
from firmware_host.daemon import Shutdown, WatchdogFeed
from firmware_host.log.recorder import Recorder
from firmware_host.loop import Loop
from firmware_host.loop_timing import Histogram
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.operator.status_socket import StatusSocket
from firmware_host.ticker import Tick, Ticker

BAR_RATIO = 2.0
TURN_S = 5.0
SETTLING_S = 2.0  # of walking, until the first stride has begun
LONGEST_STEP_S = 15.0  # for the robot's process to start, or for a mode to come about
TIMER_ABSTIME = 1
FRACTIONS = {"p50": 0.50, "p99": 0.99, "p99.9": 0.999}


class Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


class Punctuality:
    """Owns what was seen of one loop in all its turns."""

    def __init__(self) -> None:
        self.late, self.work = Histogram(), Histogram()
        self.missed = 0

    def add(self, late_s: float, missed: int, work_s: float = 0.0) -> None:
        self.late.add(late_s)
        self.work.add(work_s)
        self.missed += missed

    def report(self) -> dict[str, Any]:
        return {
            "ticks": self.late.count,
            "missed": self.missed,
            "late_us": {name: self.late.percentile_us(fraction) for name, fraction in FRACTIONS.items()}
            | {"max": round(self.late.max_us, 1)},
        }


class BareLoop:
    """Nothing but deadlines."""

    def __init__(self) -> None:
        self._sleep = ctypes.CDLL(None).clock_nanosleep
        self._until = Timespec()

    def run(self, seconds: float, punctuality: Punctuality) -> None:
        start_s, number, last = time.monotonic(), 0, round(seconds / PERIOD_S)
        while number < last:
            number += 1
            deadline_s = start_s + number * PERIOD_S
            self._sleep_until(deadline_s)
            late_s = time.monotonic() - deadline_s
            missed = int(late_s / PERIOD_S)
            number += missed
            punctuality.add(late_s, missed)

    def _sleep_until(self, deadline_s: float) -> None:
        self._until.seconds = int(deadline_s)
        self._until.nanoseconds = int(deadline_s % 1.0 * 1e9)
        self._sleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, ctypes.byref(self._until), None)


class DaemonLoop:
    """The daemon's parts and its loop's body; what it opens is closed with `stack`."""

    def __init__(self, configuration: Configuration, folder: Path, stack: ExitStack) -> None:
        drives = make_drives(
            configuration.drive, open_ports(configuration.bus), configuration.limits, configuration.watchdog_endpoints
        )
        stack.callback(drives.close)
        pose = PosePort(Path(configuration.pose.socket))
        stack.callback(pose.close)
        self.recorder = Recorder(folder / "jitter.mcap", configuration.text, {})
        stack.callback(self.recorder.close, timeout_s=10.0)
        self.loop = Loop(configuration, drives, pose, self.recorder)
        calls = OperatorCalls(self.loop, self.recorder, [], time.monotonic)
        self._status = StatusSocket(Path(configuration.status.socket), calls.methods)
        stack.callback(self._status.close)
        self._watchdog, self._shutdown = WatchdogFeed(SystemdNotifier("")), Shutdown()
        self.faults = 0

    def tick(self, ticker: Ticker) -> Tick:
        """As in firmware_host.daemon."""
        tick = ticker.wait()
        self.loop.tick(tick)
        self._status.serve(tick.now_s)
        self._watchdog.update(tick, self.loop.mode)
        self._shutdown.step(self.loop, tick.now_s)
        return tick

    def run(self, seconds: float, punctuality: Punctuality) -> None:
        """Raises RuntimeError where the robot does not arm."""
        self._begin_walk()
        ticker, end_s = Ticker(), time.monotonic() + seconds
        tick = self.tick(ticker)
        while tick.now_s < end_s:
            tick = self.tick(ticker)
            punctuality.add(tick.late_s, tick.missed, time.monotonic() - tick.now_s)
        self.faults += self.loop.mode is not Mode.WALKING
        self.loop.request(Request.DISARM, time.monotonic())
        self._run_until(lambda: not any(state.closed_loop for state in self.loop.states))

    def _begin_walk(self) -> None:
        """Restores the loop after the bare loop's turn, in which the buses were not read."""
        self._run_until(lambda: self.loop.mode in (Mode.IDLE, Mode.FAULT))
        self.loop.request(Request.CLEAR, time.monotonic())
        self._run_until(lambda: self.loop.mode is Mode.IDLE and not self.loop.faults.blocking())
        self.loop.request(Request.ARM, time.monotonic())
        self._run_until(lambda: self.loop.mode is Mode.HOLD)
        order = WalkOrder(self.loop.configuration.adaptation.initial_depth_m)
        self.loop.request(Request.WALK, time.monotonic(), order)
        settled_s = time.monotonic() + SETTLING_S
        self._run_until(lambda: time.monotonic() > settled_s)

    def _run_until(self, done: Callable[[], bool]) -> None:
        ticker, deadline_s = Ticker(), time.monotonic() + LONGEST_STEP_S
        while not done():
            if self.tick(ticker).now_s > deadline_s:
                raise RuntimeError(f"the simulated robot is {self.loop.mode.name.lower()}: {self.loop.fault}")


def measure(seconds: float) -> dict[str, Any]:
    real, bare, turn_s = Punctuality(), Punctuality(), min(TURN_S, seconds)
    rounds = max(1, round(seconds / turn_s))
    progress = Progress(rounds)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mudskipper-")))
        robot = LocalRobot(folder)
        stack.callback(robot.end)
        configuration = load_configuration(robot.configuration)
        daemon, bare_loop = DaemonLoop(configuration, folder, stack), BareLoop()
        options = configuration.loop
        warnings = prepare_loop(options.priority, options.cpu, options.lock_memory)
        for number in range(rounds):
            progress.show(number, "the daemon's loop")
            daemon.run(turn_s, real)
            progress.show(number + 0.7, "the bare loop")
            bare_loop.run(turn_s, bare)
    seen = {"faults": daemon.faults, "dropped_rows": daemon.recorder.dropped, "warnings": warnings}
    loop = real.report() | {"work_us": real.work.summary()}
    return {"rounds": rounds, "turn_s": turn_s, "loop": loop, "bare": bare.report()} | seen


def ratios(real: dict[str, Any], bare: dict[str, Any]) -> dict[str, float]:
    return {
        fraction: round(real["late_us"][fraction] / max(1.0, bare["late_us"][fraction]), 2)
        for fraction in ("p50", "p99")
    }


def measure_all(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    report: dict[str, Any] = {"seconds": options.seconds, "bar_ratio": BAR_RATIO} | measure(options.seconds)
    report["ratios"] = ratios(report["loop"], report["bare"])
    bar = f"median lateness at most {BAR_RATIO:g} times the bare loop's"
    return evaluated(report, bar, report["ratios"]["p50"] <= BAR_RATIO)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.speed.loop_jitter", __doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help=f"of each loop, in turns of {TURN_S:g} s")
    return run_benchmark(parser, arguments, measure_all)


if __name__ == "__main__":
    sys.exit(main())
