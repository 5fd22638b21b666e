"""Runs the daemon and the simulated robot as processes on local buses, for benchmarks that kill or soak them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from firmware_host.operator.status_client import NoDaemonError, StatusClient
from simulation.harness.local_setup import write_local_setup

LONGEST_WAIT_S = 60.0


def start(module: str, configuration: Path) -> subprocess.Popen[bytes]:
    """Starts a module as the leader of a session of its own."""
    command = [sys.executable, "-m", module, "--config", str(configuration)]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, start_new_session=True, stdout=quiet, stderr=quiet)


def kill_session(process: subprocess.Popen[bytes]) -> None:
    """Kills a process of `start` with its children."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def wait_for(condition: Callable[[], bool], longest_s: float = LONGEST_WAIT_S, period_s: float = 0.02) -> bool:
    """Waits for a condition, in which a daemon may not answer yet; returns whether it came about."""
    deadline_s = time.monotonic() + longest_s
    while time.monotonic() < deadline_s:
        with suppress(NoDaemonError, OSError):
            if condition():
                return True
        time.sleep(period_s)
    return False


class LocalRobot:
    """Owns the processes of a robot, which starts at once, and of its daemon."""

    def __init__(self, folder: Path, log_lines: str = "") -> None:
        """`log_lines`: further lines of the configuration's log section."""
        self.logs, self._socket = folder / "logs", folder / "mudskipper.sock"
        self.configuration = write_local_setup(folder, self.logs)
        text = self.configuration.read_text(encoding="utf-8")
        self.configuration.write_text(text.replace("[log]\n", f"[log]\n{log_lines}"), encoding="utf-8")
        self._robot = start("simulation.harness.peer", self.configuration)
        self._daemon: subprocess.Popen[bytes] | None = None

    def start_daemon(self) -> subprocess.Popen[bytes]:
        self._daemon = start("firmware_host.daemon", self.configuration)
        return self._daemon

    def call(self, method: str, **params: Any) -> Any:
        """Calls the daemon on a connection of its own."""
        client = StatusClient(self._socket)
        try:
            return client.call(method, **params)
        finally:
            client.close()

    def replace_robot(self) -> None:
        """Replaces the robot by a new one: its joints are in range and its drives start again."""
        kill_session(self._robot)
        self._robot = start("simulation.harness.peer", self.configuration)

    def end(self) -> None:
        if self._daemon is not None:
            kill_session(self._daemon)
        kill_session(self._robot)
