"""Malformed configuration and world files: each is refused with a message, or accepted and the robot works with it.

Files of malformed_configurations.py pass through the readers of the daemon and the simulated robot. The
only permitted exception is a ConfigurationError whose messages name the wrong key, and its bound where it has one; no
file may take long or much memory. With each accepted file a robot is built in lockstep and idles; every tenth of them
arms, holds, walks for a while and disarms. Such a robot may refuse to arm (its supply may count as too low, for
example), but no tick may raise an exception, and a disarmed robot may send no frame that moves a drive.
"""

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random

from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from drivers.drive_types import DEFAULT
from experiments.bench.rig import on_bench
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration
from firmware_host.sockets.user_groups import load_rights
from simulation.harness.lockstep import Lockstep
from simulation.harness.world import World, load_world
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from verification.benchmark import Report, evaluated, run_benchmark
from verification.example_robot import load_example
from verification.stress.can_fuzz import ObservedRobot
from verification.stress.fuzz_loop import fuzz
from verification.stress.harmless_frames import is_harmless
from verification.stress.malformed_configurations import CandidateFile, next_file

LONGEST_S, MOST_KIB = 3.0, 64.0 * 1024.0  # for one file, and the walk of its robot
LONGEST_MESSAGE = 1000
IDLE_TICKS, HOLD_S, WALK_S, ARMED_FRACTION = 60, 0.2, 0.8, 10
TRACK = Track([(1.0, MUDS["48.5"])])


class Files:
    """Owns the generator of files and the counts of those that were accepted."""

    def __init__(self, path: Path, seed: int) -> None:
        self._path = path
        self._chance = Random(seed)
        self.accepted: Counter[str] = Counter()
        self.tried: Counter[str] = Counter()  # the last mode that each armed robot reached

    def try_next(self, number: int) -> tuple[str, list[str]]:
        """Read a file as the daemon or the simulated robot does; return its kind and every wrong reaction."""
        file = next_file(self._chance)
        self._path.write_bytes(file.data)
        try:
            read = load_world(self._path) if file.is_world else load_configuration(self._path)
            if isinstance(read, Configuration):
                load_rights(read.status)
        except ConfigurationError as problem:
            return file.kind, list(problems_of_refusal(file, problem.problems))
        if file.wrong_key:
            return file.kind, [f"{file.wrong_key} was accepted"]
        self.accepted[file.kind] += 1
        return file.kind, self._try_out(read, self.accepted.total() % ARMED_FRACTION == 0)

    def _try_out(self, read: Configuration | World, armed: bool) -> list[str]:
        robot = build(read)
        problems = idle(robot)
        if armed:
            self.tried[walk(robot)] += 1
            problems += [f"after disarming: {problem}" for problem in idle(robot)]
        return problems


def problems_of_refusal(file: CandidateFile, problems: list[str]) -> Iterator[str]:
    """Check that a refusal names the wrong key and its bound."""
    if not problems or not all(isinstance(problem, str) and problem for problem in problems):
        yield f"refused without a message: {problems!r}"
    longest = max(map(len, problems), default=0)
    if longest > LONGEST_MESSAGE:
        yield f"a message of {longest} characters"
    reported = [problem for problem in problems if problem.startswith(file.wrong_key[:80])]
    if not reported:
        yield f"{file.wrong_key} is not named: {problems[:3]}"
    elif not any(file.bound in problem for problem in reported):
        yield f"{file.wrong_key}: the bound {file.bound} is not named: {reported}"


def build(read: Configuration | World) -> Lockstep:
    if isinstance(read, Configuration):
        return Lockstep(on_bench(read), TRACK)  # a file without a calibration is not armed
    configuration = load_example()
    return Lockstep(configuration, read.track, plant=read.plant(configuration), drives=read.drives(configuration))


def idle(robot: Lockstep) -> list[str]:
    """Return what is wrong with a robot that is not armed."""
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
    """Return the last mode that the robot reaches."""
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


def measure(folder: Path, *, configurations: int = 10_000, seed: int = 1) -> Report:
    files = Files(folder / "candidate.toml", seed)
    found = fuzz(configurations, "files", files.try_next)
    report = found.report() | {
        "configurations": configurations,
        "seed": seed,
        "accepted": {kind: files.accepted[kind] for kind in found.outcomes},
        "accepted_fraction": round(files.accepted.total() / configurations, 3),
        "tried": dict(files.tried),
    }
    reached = not found.bugs and found.slowest_s < LONGEST_S and found.most_kib < MOST_KIB
    return evaluated(report, "refused with messages or accepted and working, within 3 s and 64 MiB each", reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
