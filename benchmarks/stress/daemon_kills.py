"""Measures how long motors exert torque after SIGKILL or SIGSTOP of the daemon, in each phase of the gait.

Daemon and simulated robot are processes on local buses, on which a third node listens. The drives report their currents
every 2 ms of their own time, so the number of reports of a current after the kill is the time to zero torque, on a busy
machine too. Only the drives' watchdogs can end the torque. A stopped daemon is then continued, and must not move the
robot again; the third node checks that as well.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from benchmarks.local_robot import LONGEST_WAIT_S, LocalRobot
from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from control.records import JOINTS
from drivers.odrive import codec
from firmware_host.buses import open_ports
from firmware_host.configuration.loading import load_configuration
from firmware_host.operator.status_client import CallRefusedError, NoDaemonError
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness.peer import WATCHDOG_S

REPORTED_S = SimulatedDriveParameters(0).current_period_s
TOLERANCE_S = 0.01  # between the kill and the robot's reading of what was sent before it
WINDOW_S = 4.0 * WATCHDOG_S  # of listening
PHASES = ("insertion", "stance", "extraction", "swing", "hold")
SIGNALS = (signal.SIGKILL, signal.SIGSTOP)
ATTEMPTS = 5  # at a walk, which may fail on a busy machine


class Listener:
    """Owns a node on each bus, and counts the reports of current from each drive."""

    def __init__(self, configuration_path: Path) -> None:
        configuration = load_configuration(configuration_path)
        self._ports = open_ports(configuration.bus)
        self._joints = {(configuration.drive[joint].bus, configuration.drive[joint].node_id): joint for joint in JOINTS}
        self.reset()

    def reset(self) -> None:
        self.reported = dict.fromkeys(JOINTS, 0)  # messages of current
        self.pushed = dict.fromkeys(JOINTS, 0)  # of these, until the last one that was not of zero
        self.closed_loop = dict.fromkeys(JOINTS, True)

    def listen(self) -> None:
        for bus, port in self._ports.items():
            for frame in port.receive():
                joint = self._joints.get((bus, frame.arbitration_id >> 5))
                if joint is not None and not frame.is_remote:
                    self._handle(joint, frame.arbitration_id & 0x1F, frame.data)

    def _handle(self, joint: str, command: int, data: bytes) -> None:
        if command == codec.GET_IQ.command:
            self.reported[joint] += 1
            if codec.GET_IQ.decode(data)[0] != 0.0:
                self.pushed[joint] = self.reported[joint]
        elif command == codec.HEARTBEAT.command:
            self.closed_loop[joint] = codec.HEARTBEAT.decode(data)[1] == codec.AxisState.CLOSED_LOOP

    def listen_for(self, drive_time_s: float) -> None:
        """Listens for a duration that the drives' own messages measure."""
        deadline_s = time.monotonic() + LONGEST_WAIT_S
        end = max(self.reported.values()) + round(drive_time_s / REPORTED_S)
        while min(self.reported.values()) < end and time.monotonic() < deadline_s:
            self.listen()
            time.sleep(0.005)

    def close(self) -> None:
        for port in self._ports.values():
            port.close()


class Session(LocalRobot):
    """Owns a robot, its daemon and the listening node."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.daemon = self.start_daemon()
        self.listener = Listener(self.configuration)

    def wait_for(self, *modes_or_phases: str) -> bool:
        """Returns whether one of them was reached before a fault."""
        deadline_s = time.monotonic() + LONGEST_WAIT_S
        while time.monotonic() < deadline_s:
            self.listener.listen()
            with suppress(NoDaemonError, OSError):
                report = self.call("status")
                ready = report["mode"] != "idle" or report["fault"] is None
                if ready and {report["mode"], report["phase"]} & set(modes_or_phases):
                    return True
                if report["mode"] in ("fault", "damping"):
                    return False
            time.sleep(0.002)
        return False

    def walk_until(self, phase: str) -> bool:
        if not self.wait_for("idle"):
            return False
        with suppress(CallRefusedError):
            self.call("arm")
            if self.wait_for("hold") and phase != "hold":
                self.call("walk", depth_m=0.03)
        return self.wait_for(phase)

    def end(self) -> None:
        self.listener.close()
        super().end()


def kill_once(folder: Path, number: signal.Signals, phase: str) -> dict[str, Any] | None:
    """Returns None where the robot did not reach that phase."""
    session = Session(folder)
    listener = session.listener
    try:
        if not session.walk_until(phase):
            return None
        listener.listen()
        listener.reset()
        session.daemon.send_signal(number)
        listener.listen_for(WINDOW_S)
        pushed_s = REPORTED_S * max(listener.pushed.values())
        idle = not any(listener.closed_loop.values())
        woken = number is signal.SIGSTOP and _moves_when_woken(session.daemon, listener)
    finally:
        session.end()
    return {"signal": number.name, "phase": phase, "pushed_s": round(pushed_s, 4), "idle": idle, "moved_again": woken}


def _moves_when_woken(daemon: subprocess.Popen[bytes], listener: Listener) -> bool:
    listener.reset()
    daemon.send_signal(signal.SIGCONT)
    listener.listen_for(WINDOW_S)
    return any(listener.pushed.values()) or any(listener.closed_loop.values())


def kill_many(count: int, folder: Path, progress: Progress) -> tuple[list[dict[str, Any]], int]:
    """Returns the rounds, and the number of invalid walks."""
    rounds: list[dict[str, Any]] = []
    invalid_walks = 0
    while len(rounds) < count and invalid_walks < ATTEMPTS * count:
        progress.show(len(rounds), "kills")
        number, phase = SIGNALS[len(rounds) % 2], PHASES[len(rounds) // 2 % len(PHASES)]
        subfolder = folder / str(len(rounds) + invalid_walks)
        subfolder.mkdir()
        made = kill_once(subfolder, number, phase)
        if made is None:
            invalid_walks += 1
        else:
            rounds.append(made)
    return rounds, invalid_walks


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    rounds, invalid_walks = kill_many(options.kills, folder, Progress(options.kills))
    longest_s = max((made["pushed_s"] for made in rounds), default=0.0)
    reached = (
        len(rounds) == options.kills
        and longest_s <= WATCHDOG_S + TOLERANCE_S
        and all(made["idle"] and not made["moved_again"] for made in rounds)
    )
    bar = f"zero torque within the watchdogs' {1e3 * WATCHDOG_S:g} ms and {1e3 * TOLERANCE_S:g} in transit, for good"
    report = {"rounds": rounds, "invalid_walks": invalid_walks, "longest_s": longest_s, "watchdog_s": WATCHDOG_S}
    return evaluated(report, bar, reached)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.stress.daemon_kills", __doc__)
    parser.add_argument("--kills", type=int, default=40)
    return run_benchmark(parser, arguments, measure)


if __name__ == "__main__":
    sys.exit(main())
