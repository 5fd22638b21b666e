"""A simulated robot and a real daemon as processes, operated through the command line."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from firmware_host.operator.status_client import NoDaemonError, StatusClient
from simulation.harness.local_setup import write_local_setup
from tests.command_line.command_lines import run
from tests.waiting import LONGEST_S


class Bench:
    """Owns the processes of one test. `run` is what a person types."""

    def __init__(self, folder: Path, logs: Path) -> None:
        self.folder, self.logs = folder, logs
        self.socket = folder / "mudskipper.sock"
        self.configuration = write_local_setup(folder, logs)
        self.robot = self.start("simulation.harness.peer")
        self.daemon = self.start("firmware_host.daemon")

    def start(self, module: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", module, "--config", str(self.configuration)]
        return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return run(*arguments, MUDSKIPPER_SOCKET=str(self.socket))

    def wait_for(self, done: Callable[[dict[str, Any]], bool], longest_s: float = LONGEST_S) -> dict[str, Any]:
        deadline_s = time.monotonic() + longest_s
        report: dict[str, Any] = {}
        while time.monotonic() < deadline_s:
            try:
                client = StatusClient(self.socket)
            except NoDaemonError:
                time.sleep(0.02)
                continue
            report = client.call("status")
            client.close()
            if done(report):
                return report
            time.sleep(0.02)
        raise AssertionError(f"it never came to that: {report.get('mode')} {report.get('fault')}")

    def wait_until_ready(self) -> None:
        self.wait_for(lambda report: bool(report["mode"] == "idle" and report["fault"] is None))

    def end(self) -> None:
        for process in (self.daemon, self.robot):
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                process.wait(LONGEST_S)
            assert process.stderr is not None
            process.stderr.close()


@pytest.fixture
def bench(short_folder: Path, tmp_path: Path) -> Iterator[Bench]:
    made = Bench(short_folder, tmp_path / "logs")
    try:
        made.wait_until_ready()
        yield made
    finally:
        made.end()
