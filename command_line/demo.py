"""`mudskipper demo`: a simulated robot as a process of its own, the real daemon against it, and a walk over three muds.

Everything happens in real time and through the interfaces that a person or a program would use. It ends with a
summary, a plot and the log.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from command_line import exit_codes
from command_line.screen import STRIDE_HEAD, STRIDE_UNITS, complain, mud_text, stride_line
from control.modes import Mode
from firmware_host.log_folder import DONE, log_files, present_path
from firmware_host.log_reader import Log, LogError, read_log
from firmware_host.status_client import CallRefusedError, NoDaemonError, StatusClient
from firmware_host.toml_records import ConfigurationError
from simulation.local_setup import write_local_setup
from simulation.peer import end_with_parent
from simulation.track import Track, paper_track
from simulation.world import load_world

LONGEST_WALK_S = 60.0
STARTING_S = 20.0
MODE_S = 10.0
ENDING_S = 15.0  # for one process, after which it is killed
POLL_S = 0.05
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FINISH_M = 0.02  # before the end of the track
LEAD_M = 0.06  # the flippers are in the mud about this far ahead of the body's middle when a stride begins


def _begin(signals_waiting: set[int | signal.Signals]) -> None:
    """In a process that was just forked."""
    signal.pthread_sigmask(signal.SIG_SETMASK, signals_waiting)
    end_with_parent()


class DemoError(Exception):
    """The demo cannot go on; the text says why."""


class InterruptedDemoError(Exception):
    """A person has ended the demo; the text says in which state."""


class Demo:
    """Owns the two processes, the client and what was learned so far."""

    def __init__(self, folder: Path, logs: Path, seed: int, world: Path | None = None) -> None:
        self.folder = folder
        self.seed = seed
        self.track: Track = load_world(world).track if world else paper_track()
        self.configuration_path = write_local_setup(folder, logs)
        self.output = (folder / "output.txt").open("w+", encoding="utf-8")
        ground = () if world is None else ("--world", str(world))
        self.robot = self._start("simulation.peer", "--seed", str(seed), *ground)
        self.daemon = self._start("firmware_host.daemon")
        self.client: StatusClient | None = None
        self.strides: list[dict[str, Any]] = []
        self.walk_start_s = 0.0
        self.armed = False

    def _start(self, module: str, *arguments: str) -> subprocess.Popen[bytes]:
        """In a session of its own, so that Ctrl-C reaches only us and we end things in order.

        A signal waits until the fork is over: Python drops an exception that it raises in there.
        """
        waiting = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        try:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", module, "--config", str(self.configuration_path), *arguments],
                stdin=subprocess.DEVNULL,
                stdout=self.output,
                stderr=self.output,
                start_new_session=True,
                preexec_fn=partial(_begin, waiting),  # noqa: PLW1509 - no threads here
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, waiting)

    def connect(self) -> StatusClient:
        deadline_s = time.monotonic() + STARTING_S
        while time.monotonic() < deadline_s:
            self._look_after_processes()
            try:
                self.client = StatusClient(self.folder / "mudskipper.sock")
                return self.client
            except NoDaemonError:
                time.sleep(POLL_S)
        raise DemoError("the daemon does not answer")

    def _look_after_processes(self) -> None:
        for name, process in (("simulated robot", self.robot), ("daemon", self.daemon)):
            if process.poll() is not None:
                raise DemoError(f"the {name} ended with status {process.returncode}: {self.last_words()}")

    def last_words(self) -> str:
        self.output.flush()
        lines = (self.folder / "output.txt").read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return lines[-1] if lines else "it said nothing"

    def wait_for(self, done: Callable[[dict[str, Any]], bool], longest_s: float = MODE_S) -> dict[str, Any]:
        assert self.client is not None
        deadline_s = time.monotonic() + longest_s
        while time.monotonic() < deadline_s:
            self._look_after_processes()
            report: dict[str, Any] = self.client.call("status")
            if report["mode"] == "fault":
                raise DemoError(f"fault: {report['fault']['sentence']}")
            if done(report):
                return report
            time.sleep(POLL_S)
        raise DemoError(f"still {report['mode']} after {longest_s:g} s: {report['fault']}")

    def arm(self) -> None:
        assert self.client is not None
        self.wait_for(lambda report: report["mode"] == "idle" and report["fault"] is None)
        self.armed = True
        self.client.call("arm")
        self.wait_for(lambda report: bool(report["mode"] == "hold"))

    def walk(self, depth_cm: float | None, show: Callable[[dict[str, Any]], None]) -> None:
        """To the end of the track, or as long as there is patience."""
        assert self.client is not None
        self.client.call("reset_timing")
        params = {} if depth_cm is None else {"depth_m": depth_cm / 100.0}
        self.client.call("walk", **params)
        self.walk_start_s = time.monotonic()
        end_m = self.track.length_m - FINISH_M
        while time.monotonic() < self.walk_start_s + LONGEST_WALK_S:
            report = self.wait_for(lambda _: True)
            self.fetch_strides(show)
            if report["body_x_m"] is not None and report["body_x_m"] >= end_m:
                return
            time.sleep(POLL_S)

    def fetch_strides(self, show: Callable[[dict[str, Any]], None]) -> None:
        assert self.client is not None
        while fetched := self.client.call("strides", since=len(self.strides)):
            for stride in fetched:
                self.strides.append(stride)
                show(stride)

    def stop(self) -> dict[str, Any]:
        """Flippers up, torque off; the last status."""
        assert self.client is not None
        self.client.call("stop")
        self.wait_for(lambda report: bool(report["mode"] in ("hold", "idle")))
        report: dict[str, Any] = self.client.call("status")
        self.client.call("disarm")
        return report

    def last_state(self) -> str:
        """After the end, in words."""
        if not self.armed:
            return "stopped before torque was on"
        if self.daemon.returncode == 0:
            return "stopped: torque is off, the log is closed"
        return f"stopped, but the daemon ended with status {self.daemon.returncode}"

    def end(self) -> None:
        """The daemon first: it stops the robot by itself if it has to, and needs it alive for that.

        It takes a moment, in which no further Ctrl-C is heard.
        """
        handlers = {number: signal.signal(number, signal.SIG_IGN) for number in ENDING_SIGNALS}
        if self.client is not None:
            self.client.close()
        for process in (self.daemon, self.robot):
            if process.poll() is not None:
                continue
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(ENDING_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.output.close()
        for number, handler in handlers.items():
            signal.signal(number, handler)


@contextmanager
def running_demo(logs: Path, seed: int, world: Path | None = None) -> Iterator[Demo]:
    """A demo whose processes and folder are gone afterwards, whatever happens."""
    folder = Path(tempfile.mkdtemp(prefix="mudskipper-"))  # short, as the path of a Unix socket must be
    try:
        demonstration = Demo(folder, logs, seed, world)
        try:
            yield demonstration
        except KeyboardInterrupt:
            demonstration.end()
            raise InterruptedDemoError(demonstration.last_state()) from None
        finally:
            demonstration.end()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def demo(options: argparse.Namespace) -> int:
    for number in ENDING_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup wants it
            signal.signal(number, signal.default_int_handler)  # they all end the demo as Ctrl-C does
    try:
        if options.world:
            load_world(options.world)
    except ConfigurationError as problem:
        for sentence in problem.problems:
            complain(sentence)
        return exit_codes.CONFIGURATION
    options.out.mkdir(parents=True, exist_ok=True)
    if options.json and not os.access(options.json if options.json.exists() else options.json.parent, os.W_OK):
        complain(f"{options.json} cannot be written")
        return exit_codes.UNHEALTHY
    before = set(log_files(options.out, DONE))
    try:
        report, demonstration = _perform(options)
        _conclude(options, report, demonstration)
    except (DemoError, CallRefusedError, NoDaemonError, LogError) as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    except (InterruptedDemoError, KeyboardInterrupt) as problem:
        for path in sorted(set(log_files(options.out, DONE)) - before):
            print(f"\nlog      {path}")
        complain(str(problem) or "stopped")
        return exit_codes.INTERRUPTED
    return exit_codes.OK


def _perform(options: argparse.Namespace) -> tuple[dict[str, Any], Demo]:
    print("Starting a simulated robot and the daemon ...", flush=True)
    with running_demo(options.out, options.seed, options.world) as demonstration:
        os.nice(5)  # whoever watches gives way to those who work
        demonstration.connect()
        print("Arming ...", flush=True)
        demonstration.arm()
        muds = ", ".join(mud_text(segment.clay.name) for segment in demonstration.track.segments)
        water = " water" if muds.endswith("%") else ""
        print(f"Walking {demonstration.track.length_m:.2f} m over mud with {muds}{water}.\n")
        print(f"{STRIDE_HEAD}\n{STRIDE_UNITS}", flush=True)

        def show(stride: dict[str, Any]) -> None:
            print(stride_line(stride, demonstration.walk_start_s), flush=True)

        demonstration.walk(options.depth, show)
        report = demonstration.stop()
        demonstration.fetch_strides(show)
        return report, demonstration


def _conclude(options: argparse.Namespace, report: dict[str, Any], demonstration: Demo) -> None:
    """Summary, plot, and the JSON if wanted."""
    log_path = present_path(Path(report["log"]["path"]))
    log = read_log(log_path)
    plot_path = options.out / log_path.with_suffix(".png").name
    summary = summarise(report, demonstration, log, log_path, plot_path)
    print(f"\n{summary_text(summary)}\nDrawing ...", flush=True)
    from command_line.plots import plot_walk  # matplotlib takes its time; the walk must not wait for it
    from command_line.recorded_walk import read_walk

    plot_walk(read_walk(log_path), plot_path, demonstration.track)
    print(f"plot     {plot_path}")
    if options.json:
        options.json.write_text(json.dumps(summary, indent=1) + os.linesep, encoding="utf-8")


def summarise(report: dict[str, Any], demonstration: Demo, log: Log, log_path: Path, plot_path: Path) -> dict[str, Any]:
    track = demonstration.track
    stamps_s, places_m = walked_path(log)
    strides = []
    for stride in demonstration.strides:
        start_m = float(np.interp(stride["t_start_s"], stamps_s, places_m)) if len(stamps_s) else 0.0
        strides.append(stride | {"mud": track.clay_at(start_m + LEAD_M).name})
    return {
        **report["loop"],
        "strides": strides,
        "speed_cm_s": speeds_cm_s(stamps_s, places_m, track),
        "dropped_rows": report["log"]["dropped"],
        "warnings": report["warnings"],
        "log": str(log_path),
        "plot": str(plot_path),
    }


def walked_path(log: Log) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """(time in s, body's place in m) of the ticks in which the robot walked and its pose was known."""
    rows = log.ticks[(log.ticks["mode"] == Mode.WALKING) & np.isfinite(log.ticks["body_x_m"])]
    return rows["stamp_s"], rows["body_x_m"]


def speeds_cm_s(
    stamps_s: np.ndarray[Any, Any], places_m: np.ndarray[Any, Any], track: Track
) -> dict[str, float | None]:
    """Mean speed between the first arrival in each mud and the first arrival in the next."""
    speeds: dict[str, float | None] = {}
    start_m = float(places_m[0]) if len(places_m) else 0.0
    for segment in track.segments:
        inside = np.flatnonzero(places_m >= start_m)
        beyond = np.flatnonzero(places_m >= segment.end_m)
        first = int(inside[0]) if len(inside) else -1
        last = int(beyond[0]) if len(beyond) else len(places_m) - 1
        name = segment.clay.name
        if name in speeds:  # the same mud once more
            name = f"{name} at {start_m:.2f} m"
        speeds[name] = None
        if 0 <= first < last:
            distance_m, duration_s = places_m[last] - places_m[first], stamps_s[last] - stamps_s[first]
            speeds[name] = round(100.0 * float(distance_m / duration_s), 2)
        start_m = segment.end_m
    return speeds


def summary_text(summary: dict[str, Any]) -> str:
    late, tick = summary["wake_late_us"], summary["tick_us"]
    speeds = ", ".join(
        f"{mud_text(mud)}: {'-' if speed is None else f'{speed:.1f} cm/s'}"
        for mud, speed in summary["speed_cm_s"].items()
    )
    lines = [
        f"strides  {len(summary['strides'])} of both flippers",
        f"speed    {speeds}",
        f"loop     {summary['rate_hz']:.2f} Hz over {summary['ticks']} ticks, {summary['missed_ticks']} missed",
        f"wake-up  {late['p50']:.0f} us late at the median, {late['p99']:.0f} p99, {late['max']:.0f} worst",
        f"tick     {tick['p50']:.0f} us at the median, {tick['p99']:.0f} p99, {tick['max']:.0f} worst",
        *([f"lost     {summary['dropped_rows']} rows of the log"] if summary["dropped_rows"] else []),
        *(f"warning  {warning}" for warning in summary["warnings"]),
        f"log      {summary['log']}",
    ]
    return "\n".join(lines)
