"""Measures how long motors drive their joints, and what the log loses, when the daemon or its log's writer is killed.

Daemon and simulated robot are processes on local buses. In each phase of the gait the daemon gets SIGKILL, or SIGSTOP
and later SIGCONT; or its log's writer gets SIGKILL, after which the daemon must still obey SIGTERM; or both die at
once. The robot records in every step of its own time what its motors do, so the number of steps after the kill is the
time to their end, on a busy machine too. Only the drives' watchdogs can end it. A daemon that continues must not move
the robot again, but for one command where a watchdog cannot be read: such a drive may forget that it has expired, and
follow a command that was just being sent. Every tick is logged, in short segments; recovered, the log must have all of
them but those of the last second. `--drive` takes another type of drive, such as moteus or mit:AK80-9.
"""

import os
import signal
import sys
import time
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from drivers.drive_types import DEFAULT
from logs.recovery import recover_all
from simulation.body.plant import STEP_S
from simulation.harness.peer import WATCHDOG_S
from verification.benchmark import evaluated, run_benchmark, show_progress
from verification.example_robot import require_drive
from verification.local_robot import LONGEST_WAIT_S, LocalRobot, wait_for
from verification.stress.recorded_robot import read_record
from verification.stress.resources import children_of
from verification.stress.written_rows import count_rows

TOLERANCE_S = 0.01  # between the kill and the robot's reading of what was sent before it
WINDOW_STEPS = round(4.0 * WATCHDOG_S / STEP_S)  # of observation
PHASES = ("insertion", "stance", "extraction", "swing", "hold")
VICTIMS = ("daemon", "stopped daemon", "writer", "session")  # the session: the daemon and its writer
ROUNDS = tuple(product(PHASES, VICTIMS))
ONE_COMMAND_S = 0.005  # of a daemon that continues while it was sending, until its next tick
LOST_S = 1.0  # of rows at a log's end
LOG_LINES = "segment_s = 1.5\nrest_hz = 0.0\n"
ATTEMPTS = 5  # at a walk, which may fail on a busy machine


def observe(folder: Path, from_s: float) -> npt.NDArray[Any]:
    """Wait for WINDOW_STEPS of the robot's own time, and return what its motors did in them."""
    deadline_s = time.monotonic() + LONGEST_WAIT_S
    while len(rows := read_record(folder, from_s)) < WINDOW_STEPS and time.monotonic() < deadline_s:
        time.sleep(0.05)
    if len(rows) < WINDOW_STEPS:
        raise RuntimeError("the simulated robot has ended")
    return rows[:WINDOW_STEPS]


def end_s(marked: npt.NDArray[np.bool_]) -> float:
    """Return the time to the end of the last marked step."""
    steps = marked.nonzero()[0]
    return round(STEP_S * float(steps[-1] + 1), 4) if len(steps) else 0.0


def kill_once(folder: Path, victim: str, phase: str, drive: str) -> dict[str, Any] | None:
    """Return None where the robot did not reach that phase."""
    robot = LocalRobot(folder, LOG_LINES, drive, "verification.stress.recorded_robot")
    daemon, moved_again_s = robot.start_daemon(), 0.0
    try:
        if not robot.walk_until(phase):
            return None
        writers = children_of(daemon.pid)
        killed_s = logged_s = time.monotonic()
        if victim == "session":
            os.killpg(daemon.pid, signal.SIGKILL)
        elif victim == "writer":
            for writer in writers:
                os.kill(writer, signal.SIGKILL)
            daemon.terminate()
            daemon.wait(LONGEST_WAIT_S)
            killed_s = time.monotonic()
        else:
            daemon.send_signal(signal.SIGKILL if victim == "daemon" else signal.SIGSTOP)
        rows = observe(folder, killed_s)
        if victim == "stopped daemon":
            continued_s = time.monotonic()
            daemon.send_signal(signal.SIGCONT)
            after = observe(folder, continued_s)
            moved_again_s, logged_s = end_s(after["drives"] | after["follows"]), time.monotonic()
    finally:
        robot.end()
    wait_for(lambda: all(map(_has_ended, writers)))
    complaints: list[str] = []
    recover_all(robot.logs, complaints.append)
    logged = count_rows(robot.logs)
    lost_s = round(logged_s - logged.pop("last_s"), 3)
    idle = not bool(rows["follows"][-1])
    whole = not (complaints or logged["files_not_whole"] or logged["ticks_missing"]) and lost_s <= LOST_S
    return {
        "victim": victim,
        "phase": phase,
        "driven_s": end_s(rows["drives"]),
        "idle": idle,
        "moved_again_s": moved_again_s,
        **logged,
        "lost_s": lost_s,
        "complaints": complaints,
        "sound": idle and whole and moved_again_s <= (ONE_COMMAND_S if robot.forced else 0.0),
    }


def _has_ended(process: int) -> bool:
    with suppress(OSError):
        return ") Z" in Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    return True


def measure(folder: Path, *, kills: int = 40, drive: str = DEFAULT) -> dict[str, Any]:
    require_drive(drive)
    rounds: list[dict[str, Any]] = []
    invalid_walks = 0
    while len(rounds) < kills and invalid_walks < ATTEMPTS * kills:
        show_progress(len(rounds), kills, "kills")
        phase, victim = ROUNDS[len(rounds) % len(ROUNDS)]
        subfolder = folder / str(len(rounds) + invalid_walks)
        subfolder.mkdir()
        made = kill_once(subfolder, victim, phase, drive)
        if made is None:
            invalid_walks += 1
        else:
            rounds.append(made)
    longest_s = max((made["driven_s"] for made in rounds), default=0.0)
    sound = all(made["sound"] for made in rounds)
    reached = len(rounds) == kills and longest_s <= WATCHDOG_S + TOLERANCE_S and sound
    bar = f"no driving torque after the watchdogs' {1e3 * WATCHDOG_S:g} ms and {1e3 * TOLERANCE_S:g} in transit"
    bar += f", and whole logs that lost at most {LOST_S:g} s"
    report = {"drive": drive, "rounds": rounds, "invalid_walks": invalid_walks}
    report |= {"longest_s": longest_s, "watchdog_s": WATCHDOG_S}
    return evaluated(report, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
