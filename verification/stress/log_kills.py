"""Counts the rows that a log loses when its writer, the daemon, or all processes are killed and the log is recovered.

A real daemon records a simulated robot with short segments, every tick of it. After each kill the next daemon or the
recovery command recovers the folder, and three independent readers open every log of the run: ours, rosbags and
mcap-ros2-support. Ticks are numbered and count the missed ones, so a missing or doubled row shows; the monotonic stamp
of the last row shows how much is missing at the end. `--drive` takes another type of drive, such as moteus.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from drivers.drive_types import DEFAULT
from firmware_host.log.log_folder import ACTIVE, DONE, log_files, unfinished_files
from logs.files.log_reader import Log, read_log
from logs.recovery import recover_all
from verification.benchmark import evaluated, run_benchmark, show_progress
from verification.example_robot import require_drive
from verification.local_robot import LONGEST_WAIT_S, LocalRobot, kill_session, wait_for
from verification.stress.resources import children_of

BAR_S = 1.0  # of rows at a log's end
VICTIMS = ("all", "writer", "daemon", "both")  # all: the whole session, with a recovery that may be running
LATEST_KILL_S = 2.5  # after the start: in the first or the second segment
SUMMED = ("missing_inside", "doubled", "recovered", "segments", "ticks")


def wait_for_log(robot: LocalRobot, known: set[str]) -> None:
    """Wait until the daemon answers and a file of its run exists."""

    def is_recording() -> bool:
        robot.call("hello")
        return bool({path.name for path in log_files(robot.logs, ACTIVE)} - known)

    if not wait_for(is_recording):
        raise RuntimeError("the daemon did not start")


def kill(victim: str, daemon: subprocess.Popen[bytes]) -> float:
    """Kill the victim and return the time on the monotonic clock."""
    writers = children_of(daemon.pid)
    killed_s = time.monotonic()
    if victim in ("writer", "both"):
        for writer in writers:
            os.kill(writer, signal.SIGKILL)
    if victim in ("daemon", "both"):
        daemon.kill()
    if victim == "all":
        os.killpg(daemon.pid, signal.SIGKILL)
    if victim == "writer":
        time.sleep(0.2)
        daemon.send_signal(signal.SIGTERM)  # which it must still obey
    daemon.wait(LONGEST_WAIT_S)
    for writer in writers:
        wait_for(lambda process=writer: _has_ended(process))  # type: ignore[misc]
    return killed_s


def _has_ended(process: int) -> bool:
    try:
        return ") Z" in Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    except OSError:
        return True


def examine(paths: Sequence[Path], seen_s: float, killed_s: float) -> dict[str, Any]:
    """Return the content of one run's logs, and their problems. A log without a tick lost all since it was seen."""
    logs = [read_log(path) for path in paths]
    problems = [f"{path.name} is incomplete" for path, log in zip(paths, logs, strict=True) if not log.complete]
    problems += [complaint for path, log in zip(paths, logs, strict=True) if (complaint := _by_others(path, log))]
    numbers = np.concatenate([log.ticks["tick"].astype(np.int64) for log in logs] or [np.zeros(0, np.int64)])
    missed = np.concatenate([log.ticks["missed_ticks"].astype(np.int64) for log in logs] or [np.zeros(0, np.int64)])
    gaps = np.diff(numbers) - 1 - np.diff(missed)
    stamps_s = [float(log.ticks["stamp_s"][-1]) for log in logs if len(log.ticks)]
    return {
        "segments": len(logs),
        "ticks": len(numbers),
        "missing_inside": int(gaps[gaps > 0].sum()),
        "doubled": int(len(numbers) - len(np.unique(numbers))),
        "missing_at_end_s": round(killed_s - max(stamps_s, default=seen_s), 3),
        "recovered": sum(log.metadata.get("recovered") == "true" for log in logs),
        "problems": problems,
    }


def _by_others(path: Path, log: Log) -> str:
    """Return how two independent readers differ from ours, or an empty text."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rosbags.highlevel import AnyReader

    rows = len(log.ticks) + len(log.strides) + len(log.events)
    try:
        with AnyReader([path]) as bag:
            by_rosbags = sum(1 for _ in bag.messages())
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            by_mcap_ros2 = sum(1 for _ in reader.iter_decoded_messages())
    except Exception as problem:  # noqa: BLE001 - any exception means that they did not open it
        return f"{path.name} is refused: {type(problem).__name__}: {problem}"
    return "" if rows == by_rosbags == by_mcap_ros2 else f"{path.name}: {rows}, {by_rosbags}, {by_mcap_ros2} rows"


def kill_once(robot: LocalRobot, victim: str, after_s: float) -> dict[str, Any]:
    logs = robot.logs
    known = {path.name for path in log_files(logs, ACTIVE, DONE)}
    known |= {path.name for path in unfinished_files(logs)}
    daemon = robot.start_daemon()
    try:
        wait_for_log(robot, known)
        seen_s = time.monotonic()
        time.sleep(after_s)
        killed_s = kill(victim, daemon)
    finally:
        kill_session(daemon)
    complaints: list[str] = []
    recover_all(logs, complaints.append)
    paths = [path for path in log_files(logs, DONE) if path.name not in known]
    left = [f"{path.name} was left in {ACTIVE}" for path in unfinished_files(logs)]
    found = examine(paths, seen_s, killed_s)
    found["problems"] += complaints + left
    for path in paths:
        path.unlink()
    return {"victim": victim, "after_s": round(after_s, 3)} | found


def sums_of(kills: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "worst_end_s": max(kill["missing_at_end_s"] for kill in kills),
        "without_a_tick": sum(kill["ticks"] == 0 for kill in kills),
        "unsound": sum(bool(kill["problems"]) for kill in kills),
    } | {name: sum(kill[name] for kill in kills) for name in SUMMED}


def measure(folder: Path, *, kills: int = 100, seed: int = 1, drive: str = DEFAULT) -> dict[str, Any]:
    require_drive(drive)
    chance, rounds = Random(seed), []
    robot = LocalRobot(folder, "segment_s = 1.5\nrest_hz = 0.0\n", drive)
    try:
        for number in range(kills):
            victim = VICTIMS[number % len(VICTIMS)]
            show_progress(number, kills, f"kills, now the {victim}")
            rounds.append(kill_once(robot, victim, chance.uniform(0.0, LATEST_KILL_S)))
    finally:
        robot.end()
    sums = sums_of(rounds)
    reached = not (sums["missing_inside"] or sums["doubled"] or sums["unsound"]) and sums["worst_end_s"] <= BAR_S
    report = {"drive": drive, "kills": kills, "seed": seed, "sums": sums, "rounds": rounds}
    return evaluated(report, f"every log opens, at most {BAR_S:g} s missing at its end, nothing else", reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
