"""A simulated robot and the real daemon as processes of their own, with a client that makes the robot walk.

Both run in sessions of their own, so that Ctrl-C reaches us alone and we end them in order: the daemon first, which
stops the robot by itself if it has to. Their files are in a folder that is gone afterwards.
"""

from __future__ import annotations

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

from firmware_host.operator.status_client import NoDaemonError, StatusClient
from simulation.harness.local_setup import write_local_setup
from simulation.harness.peer import end_with_parent
from simulation.harness.world import load_world
from simulation.mud.track import Track, paper_track

LONGEST_WALK_S = 60.0
STARTING_S = 20.0
MODE_S = 10.0
ENDING_S = 15.0  # for one process, after which it is killed
POLL_S = 0.05
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FINISH_M = 0.02  # before the end of the track


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
        self.robot = self._start("simulation.harness.peer", "--seed", str(seed), *ground)
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
                raise DemoError(f"fault: {report['fault']['message']}")
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
