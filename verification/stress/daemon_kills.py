"""Measures how long motors drive their joints after SIGKILL or SIGSTOP of the daemon, in each phase of the gait.

Daemon and simulated robot are processes on local buses. The robot records in every step of its own time what its motors
do, so the number of steps after the kill is the time to their end, on a busy machine too. Only the drives' watchdogs
can end it. A stopped daemon is then continued, and must not move the robot again, but for one command where a
watchdog cannot be read: such a drive may forget that it has expired, and follow a command that was just being sent.
`--drive` takes another type of drive, such as moteus or mit:AK80-9.
"""

import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from drivers.drive_types import DEFAULT
from simulation.body.plant import STEP_S
from simulation.harness.peer import WATCHDOG_S
from verification.benchmark import evaluated, run_benchmark, show_progress
from verification.example_robot import require_drive
from verification.local_robot import LONGEST_WAIT_S, LocalRobot
from verification.stress.recorded_robot import read_record

TOLERANCE_S = 0.01  # between the kill and the robot's reading of what was sent before it
WINDOW_STEPS = round(4.0 * WATCHDOG_S / STEP_S)  # of observation
PHASES = ("insertion", "stance", "extraction", "swing", "hold")
SIGNALS = (signal.SIGKILL, signal.SIGSTOP)
ONE_COMMAND_S = 0.005  # of a daemon that continues while it was sending, until its next tick
ATTEMPTS = 5  # at a walk, which may fail on a busy machine


def observe(folder: Path, from_s: float) -> npt.NDArray[Any]:
    """Wait for WINDOW_STEPS of the robot's own time, and return what its motors did in them."""
    deadline_s = time.monotonic() + LONGEST_WAIT_S
    while len(rows := read_record(folder, from_s)) < WINDOW_STEPS and time.monotonic() < deadline_s:
        time.sleep(0.05)
    if len(rows) < WINDOW_STEPS:
        raise RuntimeError("the simulated robot has ended")
    return rows[:WINDOW_STEPS]


def kill_once(folder: Path, number: signal.Signals, phase: str, drive: str) -> dict[str, Any] | None:
    """Return None where the robot did not reach that phase."""
    robot = LocalRobot(folder, drive=drive, robot="verification.stress.recorded_robot")
    daemon = robot.start_daemon()
    try:
        if not robot.walk_until(phase):
            return None
        killed_s = time.monotonic()
        daemon.send_signal(number)
        rows, moved_again_s = observe(folder, killed_s), 0.0
        if number is signal.SIGSTOP:
            continued_s = time.monotonic()
            daemon.send_signal(signal.SIGCONT)
            after = observe(folder, continued_s)
            moved_again_s = end_s(after["drives"] | after["follows"])
    finally:
        robot.end()
    made = {"signal": number.name, "phase": phase, "driven_s": end_s(rows["drives"])}
    allowed_s = ONE_COMMAND_S if robot.forced else 0.0
    idle = not bool(rows["follows"][-1])
    sound = idle and moved_again_s <= allowed_s
    return made | {"idle": idle, "moved_again_s": moved_again_s, "sound": sound}


def end_s(marked: npt.NDArray[np.bool_]) -> float:
    """Return the time to the end of the last marked step."""
    steps = marked.nonzero()[0]
    return round(STEP_S * float(steps[-1] + 1), 4) if len(steps) else 0.0


def measure(folder: Path, *, kills: int = 40, drive: str = DEFAULT) -> dict[str, Any]:
    require_drive(drive)
    rounds: list[dict[str, Any]] = []
    invalid_walks = 0
    while len(rounds) < kills and invalid_walks < ATTEMPTS * kills:
        show_progress(len(rounds), kills, "kills")
        number, phase = SIGNALS[len(rounds) % 2], PHASES[len(rounds) // 2 % len(PHASES)]
        subfolder = folder / str(len(rounds) + invalid_walks)
        subfolder.mkdir()
        made = kill_once(subfolder, number, phase, drive)
        if made is None:
            invalid_walks += 1
        else:
            rounds.append(made)
    longest_s = max((made["driven_s"] for made in rounds), default=0.0)
    sound = all(made["sound"] for made in rounds)
    reached = len(rounds) == kills and longest_s <= WATCHDOG_S + TOLERANCE_S and sound
    bar = f"no driving torque after the watchdogs' {1e3 * WATCHDOG_S:g} ms and {1e3 * TOLERANCE_S:g} in transit"
    report = {"drive": drive, "rounds": rounds, "invalid_walks": invalid_walks}
    report |= {"longest_s": longest_s, "watchdog_s": WATCHDOG_S}
    return evaluated(report, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
