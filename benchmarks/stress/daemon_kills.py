"""Measures how long motors exert torque after SIGKILL or SIGSTOP of the daemon, in each phase of the gait.

Daemon and simulated robot are processes on local buses, on which a third node listens. The drives report their currents
every 2 ms of their own time, so the number of reports of a current after the kill is the time to zero torque, on a busy
machine too. Only the drives' watchdogs can end the torque. A stopped daemon is then continued, and must not move the
robot again; the third node checks that as well.
"""

import signal
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks.local_robot import LONGEST_WAIT_S, LocalRobot
from benchmarks.report import evaluated, run_benchmark, show_progress
from drivers.odrive import codec
from firmware_host.buses import open_ports
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
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

    def __init__(self, configuration: Configuration) -> None:
        self._ports = open_ports(configuration.bus)
        drives = [(joint, configuration.drive[joint]) for joint in configuration.rig.joints]
        self._joints = {(drive.bus, drive.node_id): joint for joint, drive in drives}
        self.reset()

    def reset(self) -> None:
        joints = self._joints.values()
        self.reported = dict.fromkeys(joints, 0)  # messages of current
        self.pushed = dict.fromkeys(joints, 0)  # of these, until the last one that was not of zero
        self.closed_loop = dict.fromkeys(joints, True)

    def listen(self) -> None:
        """Listens for WINDOW_S of the drives' own time, which their messages measure."""
        deadline_s, end = time.monotonic() + LONGEST_WAIT_S, round(WINDOW_S / REPORTED_S)
        while min(self.reported.values()) < end and time.monotonic() < deadline_s:
            for bus, port in self._ports.items():
                for frame in port.receive():
                    joint = self._joints.get((bus, frame.arbitration_id >> 5))
                    if joint is not None and not frame.is_remote:
                        self._handle(joint, frame.arbitration_id & 0x1F, frame.data)
            time.sleep(0.005)

    def _handle(self, joint: str, command: int, data: bytes) -> None:
        if command == codec.GET_IQ.command:
            self.reported[joint] += 1
            if codec.GET_IQ.decode(data)[0] != 0.0:
                self.pushed[joint] = self.reported[joint]
        elif command == codec.HEARTBEAT.command:
            self.closed_loop[joint] = codec.HEARTBEAT.decode(data)[1] == codec.AxisState.CLOSED_LOOP

    def close(self) -> None:
        for port in self._ports.values():
            port.close()


def kill_once(folder: Path, number: signal.Signals, phase: str) -> dict[str, Any] | None:
    """Returns None where the robot did not reach that phase."""
    robot = LocalRobot(folder)
    daemon, configuration = robot.start_daemon(), load_configuration(robot.configuration)
    try:
        if not robot.walk_until(phase):
            return None
        listener = Listener(configuration)
        daemon.send_signal(number)
        listener.listen()
        pushed_s = REPORTED_S * max(listener.pushed.values())
        idle, moved_again = not any(listener.closed_loop.values()), False
        if number is signal.SIGSTOP:
            listener.reset()
            daemon.send_signal(signal.SIGCONT)
            listener.listen()
            moved_again = any(listener.pushed.values()) or any(listener.closed_loop.values())
        listener.close()
    finally:
        robot.end()
    made = {"signal": number.name, "phase": phase, "pushed_s": round(pushed_s, 4)}
    return made | {"idle": idle, "moved_again": moved_again}


def measure(folder: Path, *, kills: int = 40) -> dict[str, Any]:
    rounds: list[dict[str, Any]] = []
    invalid_walks = 0
    while len(rounds) < kills and invalid_walks < ATTEMPTS * kills:
        show_progress(len(rounds), kills, "kills")
        number, phase = SIGNALS[len(rounds) % 2], PHASES[len(rounds) // 2 % len(PHASES)]
        subfolder = folder / str(len(rounds) + invalid_walks)
        subfolder.mkdir()
        made = kill_once(subfolder, number, phase)
        if made is None:
            invalid_walks += 1
        else:
            rounds.append(made)
    longest_s = max((made["pushed_s"] for made in rounds), default=0.0)
    sound = all(made["idle"] and not made["moved_again"] for made in rounds)
    reached = len(rounds) == kills and longest_s <= WATCHDOG_S + TOLERANCE_S and sound
    bar = f"zero torque within the watchdogs' {1e3 * WATCHDOG_S:g} ms and {1e3 * TOLERANCE_S:g} in transit, for good"
    report = {"rounds": rounds, "invalid_walks": invalid_walks, "longest_s": longest_s, "watchdog_s": WATCHDOG_S}
    return evaluated(report, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
