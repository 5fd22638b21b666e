"""Runs the daemon and the simulated robot as processes on local buses, for benchmarks that kill or time them.

Where drives cannot report their watchdogs, the robot is armed by force, as an operator has to.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from control.rate import RATE_HZ
from drivers.drive_types import DEFAULT
from firmware_host.configuration.loading import parse_configuration
from operator_client.status_client import CallRefusedError, NoDaemonError, StatusClient
from simulation.harness.drive_presets import with_drive_type
from simulation.harness.local_setup import write_local_setup
from simulation.harness.peer import WATCHDOG_S

LONGEST_WAIT_S = 60.0


def kill_session(process: subprocess.Popen[bytes]) -> None:
    """Kill a process of LocalRobot with its children."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def wait_for(condition: Callable[[], bool]) -> bool:
    """Wait for a condition, in which a daemon may not answer yet; return whether it came about."""
    deadline_s = time.monotonic() + LONGEST_WAIT_S
    while time.monotonic() < deadline_s:
        with suppress(NoDaemonError, OSError):
            if condition():
                return True
        time.sleep(0.005)
    return False


class LocalRobot:
    """Owns the processes of a robot, which starts at once, and of its daemon. Each leads a session of its own."""

    def __init__(
        self, folder: Path, log_lines: str = "", drive: str = DEFAULT, robot: str = "command_line.main simulate"
    ) -> None:
        """`log_lines`: further lines of the configuration's log section. `robot`: the module to run as it."""
        self.logs, self.socket = folder / "logs", folder / "mudskipper.sock"
        self.configuration = write_local_setup(folder, self.logs)
        text = self.configuration.read_text(encoding="utf-8")
        text = with_drive_type(text.replace("[log]\n", f"[log]\n{log_lines}"), drive, watchdog_s=WATCHDOG_S)
        self.configuration.write_text(text, encoding="utf-8")
        known = all(each.knows_watchdog for each in parse_configuration(text).drive.values())
        self.forced = "" if known else "watchdog_unknown"
        self._processes: list[subprocess.Popen[bytes]] = []
        self._start(*robot.split())

    def start_daemon(self, rate_hz: float = RATE_HZ) -> subprocess.Popen[bytes]:
        if rate_hz == RATE_HZ:
            return self._start("firmware_host.daemon")
        return self._start("verification.speed.daemon_at_rate", "--rate", str(rate_hz))

    def _start(self, module: str, *options: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", module, *options, "--config", str(self.configuration)]
        quiet = subprocess.DEVNULL
        self._processes.append(subprocess.Popen(command, start_new_session=True, stdout=quiet, stderr=quiet))
        return self._processes[-1]

    def call(self, method: str, **params: Any) -> Any:
        """Call the daemon on a connection of its own."""
        with StatusClient(self.socket) as client:
            return client.call(method, **params)

    def require_walk(self, rate_hz: float = RATE_HZ) -> None:
        """Arm and walk into the first stance. Ends the benchmark with a sentence where the robot does not."""
        if not self.walk_until("stance"):
            fault = self.call("status")["fault"] or {"name": "", "message": "no walk begins"}
            is_slow = fault["name"].startswith("loop_")
            why = "this machine is too slow for" if is_slow else "the simulated robot does not walk at"
            raise SystemExit(f"{why} {rate_hz:g} Hz: {fault['message']}")

    def walk_until(self, phase: str) -> bool:
        """Arm and walk; return whether this phase, or `hold` before the walk, was reached without a fault."""
        if not self._reaches("idle"):
            return False
        with suppress(CallRefusedError):
            self.call("arm", force=self.forced)
            if self._reaches("hold") and phase != "hold":
                self.call("walk", depth_m=0.03)
        return self._reaches(phase)

    def _reaches(self, mode_or_phase: str) -> bool:
        report: dict[str, Any] = {}

        def is_decided() -> bool:
            report.update(self.call("status"))
            fault = report["fault"] and report["fault"]["name"]
            ready = report["mode"] != "idle" or fault is None or fault == self.forced
            return ready and bool({report["mode"], report["phase"]} & {mode_or_phase, "fault", "damping"})

        return wait_for(is_decided) and mode_or_phase in (report["mode"], report["phase"])

    def end(self) -> None:
        for process in reversed(self._processes):
            kill_session(process)
