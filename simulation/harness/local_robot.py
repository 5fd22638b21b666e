"""A simulated robot and its daemon as two processes, in real time, with their files in one folder.

Both processes run in sessions of their own, so Ctrl-C reaches only this program. They end with it, even if it is
killed; in order the daemon ends first, because it needs the robot to stop.
"""

import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

from operator_client.status_client import NoDaemonError, StatusClient
from simulation.harness.local_setup import write_local_setup
from simulation.harness.parent_process import end_with_parent

START_TIMEOUT_S = 60.0  # of a slow or busy computer
END_TIMEOUT_S = 15.0  # of one process, which is killed then
POLL_S = 0.05


def _prepare_child(blocked_before: set[int | signal.Signals]) -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, blocked_before)
    end_with_parent()


class LocalRobot:
    """Owns the two processes."""

    def __init__(self, folder: Path, logs: Path, seed: int = 1, world: Path | None = None, text: str = "") -> None:
        """`text`: of the daemon's configuration (default: that of the simulated robot)."""
        self.socket = folder / "mudskipper.sock"
        self.configuration = write_local_setup(folder, logs, text)
        self._output = (folder / "output.txt").open("w+", encoding="utf-8", errors="replace")
        ground = () if world is None else ("--world", str(world))
        self.robot = self._start("command_line.main", "simulate", "--seed", str(seed), *ground)
        self.daemon = self._start("firmware_host.daemon")

    def _start(self, module: str, *arguments: str) -> subprocess.Popen[bytes]:
        """Start a process in a session of its own.

        Signals are blocked during the fork, in which Python drops the exception of a signal handler.
        """
        blocked_before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        try:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", module, *arguments, "--config", str(self.configuration)],
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
                start_new_session=True,
                preexec_fn=partial(_prepare_child, blocked_before),  # noqa: PLW1509 - no threads here
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked_before)

    def connect(self) -> StatusClient:
        """Return a client once the daemon answers. Raises NoDaemonError."""
        deadline_s = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < deadline_s:
            self.check_processes()
            try:
                return StatusClient(self.socket)
            except NoDaemonError:
                time.sleep(POLL_S)
        raise NoDaemonError("the daemon does not answer")

    def check_processes(self) -> None:
        """Raise NoDaemonError with the last line that an ended process printed."""
        for name, process in (("simulated robot", self.robot), ("daemon", self.daemon)):
            if process.poll() is not None:
                self._output.seek(0)
                last = (["it printed nothing"] + self._output.read().strip().splitlines())[-1]
                raise NoDaemonError(f"the {name} ended with status {process.returncode}: {last}")

    def end(self) -> None:
        """End the daemon, which stops the robot, and then the robot."""
        for process in (self.daemon, self.robot):
            if process.poll() is not None:
                continue
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._output.close()
