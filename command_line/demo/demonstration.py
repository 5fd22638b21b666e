"""Runs a simulated robot and the real daemon as two processes, and makes the robot walk through the daemon's socket.

Their files are in a folder that is removed afterwards.
"""

import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from command_line.errors import CommandError
from operator_client.status_client import StatusClient
from simulation.harness.local_robot import LocalRobot
from simulation.harness.world import load_world
from simulation.mud.track import Track, paper_track

LONGEST_WALK_S = 60.0
MODE_TIMEOUT_S = 30.0
POLL_S = 0.05
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FINISH_M = 0.02  # before the end of the track


class Demo:
    """Owns the two processes, the client, and the strides received so far."""

    def __init__(self, folder: Path, logs: Path, seed: int, world: Path | None = None) -> None:
        self.track: Track = load_world(world).track if world else paper_track()
        self.processes = LocalRobot(folder, logs, seed, world)
        self._client: StatusClient | None = None
        self.strides: list[dict[str, Any]] = []
        self.walk_start_s = 0.0
        self.armed = False

    def connect(self) -> None:
        self._client = self.processes.connect()

    def _call(self, method: str, **params: Any) -> Any:
        assert self._client is not None, "connect first"
        return self._client.call(method, **params)

    def _wait_for(self, done: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Return the first status that is `done`. Raises CommandError after MODE_TIMEOUT_S or at a fault."""
        deadline_s = time.monotonic() + MODE_TIMEOUT_S
        while time.monotonic() < deadline_s:
            self.processes.check_processes()
            report: dict[str, Any] = self._call("status")
            if report["mode"] == "fault":
                raise CommandError(f"fault: {report['fault']['message']}")
            if done(report):
                return report
            time.sleep(POLL_S)
        raise CommandError(f"still {report['mode']} after {MODE_TIMEOUT_S:g} s: {report['fault']}")

    def arm(self) -> None:
        self._wait_for(lambda report: report["mode"] == "idle" and report["fault"] is None)
        self.armed = True
        self._call("arm")
        self._wait_for(lambda report: bool(report["mode"] == "hold"))

    def walk(self, depth_cm: float | None, show: Callable[[dict[str, Any]], None]) -> None:
        """Walk to the end of the track, for LONGEST_WALK_S at most."""
        self._call("reset_timing")
        self._call("walk", **({} if depth_cm is None else {"depth_m": depth_cm / 100.0}))
        self.walk_start_s = time.monotonic()
        end_m = self.track.length_m - FINISH_M
        while time.monotonic() < self.walk_start_s + LONGEST_WALK_S:
            report = self._wait_for(lambda _: True)
            self.fetch_strides(show)
            if report["body_x_m"] is not None and report["body_x_m"] >= end_m:
                return
            time.sleep(POLL_S)

    def fetch_strides(self, show: Callable[[dict[str, Any]], None]) -> None:
        while fetched := self._call("strides", since=len(self.strides)):
            for stride in fetched:
                self.strides.append(stride)
                show(stride)

    def stop(self) -> dict[str, Any]:
        """Raises the flippers, switches torque off, and returns the last status."""
        self._call("stop")
        self._wait_for(lambda report: bool(report["mode"] in ("hold", "idle")))
        report: dict[str, Any] = self._call("status")
        self._call("disarm")
        return report

    def last_state(self) -> str:
        if not self.armed:
            return "stopped before torque was on"
        if self.processes.daemon.returncode == 0:
            return "stopped: torque is off, the log is closed"
        return f"stopped, but the daemon ended with status {self.processes.daemon.returncode}"

    def end(self) -> None:
        """End the daemon, which stops the robot, and then the robot. Further signals are ignored meanwhile."""
        handlers = {number: signal.signal(number, signal.SIG_IGN) for number in ENDING_SIGNALS}
        if self._client is not None:
            self._client.close()
        self.processes.end()
        for number, handler in handlers.items():
            signal.signal(number, handler)


@contextmanager
def running_demo(logs: Path, seed: int, world: Path | None = None) -> Iterator[Demo]:
    """Yield a demo and end its processes. A KeyboardInterrupt then says in which state."""
    folder = Path(tempfile.mkdtemp(prefix="mudskipper-"))  # short, as the path of a Unix socket must be
    try:
        demonstration = Demo(folder, logs, seed, world)
        try:
            yield demonstration
        except KeyboardInterrupt:
            demonstration.end()
            raise KeyboardInterrupt(demonstration.last_state()) from None
        finally:
            demonstration.end()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
