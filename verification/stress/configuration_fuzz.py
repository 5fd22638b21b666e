"""Malformed configuration and world files: each is refused with a message, or accepted and the robot works with it.

Files of malformed_configurations.py pass through the readers of the daemon and the simulated robot. The
only permitted exception is a ConfigurationError whose messages name the wrong key, and its bound where it has one; no
file may take long or much memory. With each accepted file a robot is built in lockstep and idles; every tenth of them
arms, holds, walks for a while and disarms. Such a robot may refuse to arm (its supply may count as too low, for
example), but no tick may raise an exception, and a disarmed robot may send no frame that moves a drive.
"""

import sys
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from drivers.drive_types import DEFAULT
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration
from firmware_host.sockets.user_groups import load_rights
from simulation.harness.lockstep import Lockstep
from simulation.harness.world import World, load_world
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from verification.benchmark import evaluated, run_benchmark, show_progress
from verification.example_robot import load_example
from verification.stress.can_fuzz import ObservedRobot
from verification.stress.harmless_frames import is_harmless
from verification.stress.malformed_configurations import CandidateFile, next_file
from verification.stress.resources import peak_kib

LONGEST_S, MOST_KIB = 1.0, 64.0 * 1024.0  # for one file
LONGEST_MESSAGE = 1000
IDLE_TICKS, HOLD_S, WALK_S, ARMED_FRACTION = 60, 0.2, 0.8, 10
TRACK = Track([(1.0, MUDS["48.5"])])


@dataclass
class Fuzzing:
    """The results of all files."""

    kinds: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    bugs: list[str] = field(default_factory=list)
    tried: Counter[str] = field(default_factory=Counter)  # the last mode that each armed robot reached
    longest_s: float = 0.0
    longest_kind: str = ""
    most_kib: float = 0.0

    def note(self, file: CandidateFile, what: str) -> None:
        self.bugs.append(f"{file.kind}: {what[:300]}")


def fuzz(count: int, seed: int, path: Path) -> Fuzzing:
    chance, found = Random(seed), Fuzzing()
    for number in range(count):
        file = next_file(chance)
        path.write_bytes(file.data)
        found.kinds[file.kind] += 1
        read = load(file, path, found)
        if read is not None:
            found.accepted[file.kind] += 1
            try_out(file, read, sum(found.accepted.values()) % ARMED_FRACTION == 0, found)
        show_progress(number, count, "files")
    return found


def load(file: CandidateFile, path: Path, found: Fuzzing) -> Configuration | World | None:
    """Reads a file as the daemon or the simulated robot does."""
    before_kib, begin_s = peak_kib(), time.thread_time()
    read: Configuration | World | None = None
    try:
        read = load_world(path) if file.is_world else load_configuration(path)
        if isinstance(read, Configuration):
            load_rights(read.status)
    except ConfigurationError as problem:
        read = None
        evaluate(file, problem.problems, found)
    except Exception as problem:  # noqa: BLE001  that none comes is what is measured
        read = None
        found.note(file, f"{type(problem).__name__}: {problem}")
    else:
        if file.wrong_key:
            found.note(file, f"{file.wrong_key} was accepted")
    _measure(file, time.thread_time() - begin_s, peak_kib() - before_kib, found)
    return read


def _measure(file: CandidateFile, duration_s: float, memory_kib: float, found: Fuzzing) -> None:
    if duration_s > found.longest_s:
        found.longest_s, found.longest_kind = duration_s, file.kind
    found.most_kib = max(found.most_kib, memory_kib)
    if duration_s > LONGEST_S or memory_kib > MOST_KIB:
        found.note(file, f"took {duration_s:.1f} s and {memory_kib:.0f} KiB")


def evaluate(file: CandidateFile, problems: list[str], found: Fuzzing) -> None:
    """Checks that a refusal names the wrong key and its bound."""
    if not problems or not all(isinstance(problem, str) and problem for problem in problems):
        found.note(file, f"refused without a message: {problems!r}")
    longest = max(map(len, problems), default=0)
    if longest > LONGEST_MESSAGE:
        found.note(file, f"a message of {longest} characters")
    reported = [problem for problem in problems if problem.startswith(file.wrong_key[:80])]
    if not reported:
        found.note(file, f"{file.wrong_key} is not named: {problems[:3]}")
    elif not any(file.bound in problem for problem in reported):
        found.note(file, f"{file.wrong_key}: the bound {file.bound} is not named: {reported}")


def try_out(file: CandidateFile, read: Configuration | World, armed: bool, found: Fuzzing) -> None:
    try:
        robot = build(read)
        for problem in idle(robot):
            found.note(file, problem)
        if armed:
            found.tried[walk(robot)] += 1
            for problem in idle(robot):
                found.note(file, f"after disarming: {problem}")
    except Exception as problem:  # noqa: BLE001
        place = traceback.extract_tb(problem.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        found.note(file, f"accepted, then {type(problem).__name__}: {problem} ({where})")


def build(read: Configuration | World) -> Lockstep:
    if isinstance(read, Configuration):
        return Lockstep(read, TRACK)
    configuration = load_example()
    return Lockstep(configuration, read.track, plant=read.plant(configuration), drives=read.drives(configuration))


def idle(robot: Lockstep) -> list[str]:
    """Returns what is wrong with a robot that is not armed."""
    if robot.loop.mode in ENERGISED:
        robot.loop.request(Request.DISARM, robot.now_s)
        robot.step()
    observed = ObservedRobot(robot)
    sent = [frame for _ in range(IDLE_TICKS) for frame in observed.step()[1]]
    harmful = [frame for frame in sent if not is_harmless(frame, DEFAULT)]
    problems = [f"sent 0x{frame.arbitration_id:03x} {frame.data.hex(' ')}" for frame in harmful[:3]]
    if robot.loop.mode in ENERGISED or any(robot.loop.sent.torques_nm):
        problems.append(f"is in mode {robot.loop.mode.name} with torques {robot.loop.sent.torques_nm}")
    return problems


def walk(robot: Lockstep) -> str:
    """Returns the last mode that the robot reaches."""
    loop = robot.loop
    robot.run_until(lambda: loop.mode is Mode.IDLE and not loop.faults.blocking(), 2.0)
    if loop.request(Request.ARM, robot.now_s):
        return "not armed"
    if not robot.run_until(lambda: loop.mode is Mode.HOLD, 1.0):
        return "fault in arming"
    if not _stays(robot, Mode.HOLD, HOLD_S):
        return "fault in hold"
    if loop.request(Request.WALK, robot.now_s, WalkOrder(loop.configuration.adaptation.initial_depth_m, True)):
        return "held"
    robot.step()
    return "walked" if _stays(robot, Mode.WALKING, WALK_S) else "fault in walking"


def _stays(robot: Lockstep, mode: Mode, duration_s: float) -> bool:
    robot.run_for(duration_s)
    return robot.loop.mode is mode


def measure(folder: Path, *, configurations: int = 10_000, seed: int = 1) -> dict[str, Any]:
    found = fuzz(configurations, seed, folder / "candidate.toml")
    report = {
        "configurations": configurations,
        "seed": seed,
        "kinds": dict(found.kinds),
        "accepted": {kind: found.accepted[kind] for kind in found.kinds},
        "accepted_fraction": round(sum(found.accepted.values()) / configurations, 3),
        "tried": dict(found.tried),
        "longest_ms": round(1e3 * found.longest_s, 1),
        "longest_kind": found.longest_kind,
        "most_kib": found.most_kib,
        "bugs": len(found.bugs),
        "first_bugs": found.bugs[:20],
    }
    bar = "refused with messages or accepted and working, within 1 s and 64 MiB each"
    return evaluated(report, bar, not found.bugs)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
