"""A simulated robot and a real daemon as processes in real time, operated through the command line."""

import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from operator_client.status_client import CallRefusedError, NoDaemonError, StatusClient
from simulation.harness.local_robot import LocalRobot
from tests.command_line.command_lines import run
from tests.waiting import LONGEST_S


class Bench(LocalRobot):
    """`run` executes a command that an operator would type."""

    def __init__(self, folder: Path, logs: Path) -> None:
        super().__init__(folder, logs)
        self.folder, self.logs = folder, logs

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return run(*arguments, MUDSKIPPER_SOCKET=str(self.socket))

    def wait_for(self, done: Callable[[dict[str, Any]], bool], longest_s: float = LONGEST_S) -> dict[str, Any]:
        deadline_s = time.monotonic() + longest_s
        report: dict[str, Any] = {}
        while time.monotonic() < deadline_s:
            with suppress(NoDaemonError), StatusClient(self.socket) as client:
                report = client.call("status")
                if done(report):
                    return report
            time.sleep(0.02)
        raise AssertionError(f"never reached: {report.get('mode')} {report.get('fault')}")

    def wait_until_ready(self) -> None:
        self.wait_for(lambda report: bool(report["mode"] == "idle" and report["fault"] is None))

    def reset(self) -> None:
        """Clears the failures, torque, joint positions beyond limits and faults that the previous test left."""
        with StatusClient(self.socket) as client:
            client.call("fail", component="all", kind="ok")
            client.call("disarm")
            self.wait_for(lambda report: report["mode"] in ("idle", "fault"))
            self.robot.send_signal(signal.SIGUSR1)  # moves the joints back
            with suppress(CallRefusedError):  # refused while joints are beyond their limits
                client.call("clear")
            self.wait_for(lambda report: report["mode"] in ("idle", "fault") and not report["failing"])
            while client.call("status")["fault"]:
                with suppress(CallRefusedError):
                    client.call("clear")
                time.sleep(0.05)
        self.wait_until_ready()

    def stop_daemon(self) -> Path:
        """Shuts the daemon down cleanly; returns its last log."""
        self.daemon.send_signal(signal.SIGTERM)
        assert self.daemon.wait(LONGEST_S) == 0
        return max((self.logs / "done").glob("*.mcap"))

    def restart_daemon(self) -> None:
        self.daemon = self._start("firmware_host.daemon")


@contextmanager
def running_bench(logs: Path) -> Iterator[Bench]:
    with tempfile.TemporaryDirectory(prefix="mud-") as folder:
        made = Bench(Path(folder), logs)
        try:
            made.wait_until_ready()
            yield made
        finally:
            made.end()


class SharedBench:
    """Owns at most one running robot, because each one loads a processor."""

    def __init__(self, folders: pytest.TempPathFactory) -> None:
        self._folders = folders
        self._running = ExitStack()
        self._bench: Bench | None = None

    def start(self) -> Bench:
        if self._bench is None:
            self._bench = self._running.enter_context(running_bench(self._folders.mktemp("bench") / "logs"))
        return self._bench

    def end(self) -> None:
        self._running.close()
        self._bench = None
