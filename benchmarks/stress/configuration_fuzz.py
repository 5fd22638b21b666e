"""Odd configuration and world files: each is refused with sentences, or accepted and the robot really works with it.

Files of benchmarks.stress.malformed_configurations go through the readers that the daemon and the simulated robot
use. Nothing
may come out but what was asked for or a ConfigurationError whose sentences name the wrong key, and its bound where it
has one; none may take long or much memory. With what is accepted a robot is built in lockstep and idles; every tenth of
them arms, holds, walks for a while and disarms. Whether such a robot may be armed is its own affair (a supply that
counts as too low stands against it), but no tick may raise an exception, and disarmed nothing may leave that moves.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.example_robot import load_example
from benchmarks.report import Progress, new_parser, run_benchmark, verdict
from benchmarks.stress.can_fuzz import is_forbidden, is_ours, port_beside
from benchmarks.stress.malformed_configurations import OddConfigurations, OddFile
from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from firmware_host.operator.rights import load_rights
from simulation.harness.lockstep import Lockstep
from simulation.harness.world import World, load_world
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

LONGEST_S, MOST_KIB = 1.0, 64.0 * 1024.0  # for one file
LONGEST_MESSAGE = 1000
IDLE_TICKS, HOLD_S, WALK_S, ARMED_FRACTION = 60, 0.2, 0.8, 10
TRACK = Track([(1.0, MUDS["48.5"])])


@dataclass
class Fuzzing:
    """What came of it."""

    kinds: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    bugs: list[str] = field(default_factory=list)
    tried: Counter[str] = field(default_factory=Counter)  # how far the ones that were armed came
    longest_s: float = 0.0
    longest_kind: str = ""
    most_kib: float = 0.0

    def note(self, odd: OddFile, what: str) -> None:
        self.bugs.append(f"{odd.kind}: {what[:300]}")


def fuzz(count: int, seed: int, folder: Path, progress: Progress) -> Fuzzing:
    source, found, path = OddConfigurations(seed), Fuzzing(), folder / "odd.toml"
    for number in range(count):
        odd = source.next_file()
        path.write_bytes(odd.data)
        found.kinds[odd.kind] += 1
        read = load(odd, path, found)
        if read is not None:
            found.accepted[odd.kind] += 1
            try_out(odd, read, sum(found.accepted.values()) % ARMED_FRACTION == 0, found)
        progress.show(number, "files")
    return found


def load(odd: OddFile, path: Path, found: Fuzzing) -> Configuration | World | None:
    """As the daemon or the simulated robot does."""
    peak_kib, begin_s = _peak_kib(), time.thread_time()
    read: Configuration | World | None = None
    try:
        read = load_world(path) if odd.is_world else load_configuration(path)
        if isinstance(read, Configuration):
            load_rights(read.status)
    except ConfigurationError as problem:
        read = None
        evaluate(odd, problem.problems, found)
    except Exception as problem:  # noqa: BLE001  that none comes is what is measured
        read = None
        found.note(odd, f"{type(problem).__name__}: {problem}")
    else:
        if odd.wrong_key:
            found.note(odd, f"{odd.wrong_key} was accepted")
    _measure(odd, time.thread_time() - begin_s, _peak_kib() - peak_kib, found)
    return read


def _peak_kib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _measure(odd: OddFile, duration_s: float, memory_kib: float, found: Fuzzing) -> None:
    if duration_s > found.longest_s:
        found.longest_s, found.longest_kind = duration_s, odd.kind
    found.most_kib = max(found.most_kib, memory_kib)
    if duration_s > LONGEST_S or memory_kib > MOST_KIB:
        found.note(odd, f"took {duration_s:.1f} s and {memory_kib:.0f} KiB")


def evaluate(odd: OddFile, problems: list[str], found: Fuzzing) -> None:
    """A refusal in sentences, of which one names what is wrong."""
    if not problems or not all(isinstance(problem, str) and problem for problem in problems):
        found.note(odd, f"refused without a sentence: {problems!r}")
    longest = max(map(len, problems), default=0)
    if longest > LONGEST_MESSAGE:
        found.note(odd, f"a sentence of {longest} characters")
    reported = [problem for problem in problems if problem.startswith(odd.wrong_key[:80])]
    if not reported:
        found.note(odd, f"{odd.wrong_key} is not named: {problems[:3]}")
    elif not any(odd.bound in problem for problem in reported):
        found.note(odd, f"{odd.wrong_key}: the bound {odd.bound} is not named: {reported}")


def try_out(odd: OddFile, read: Configuration | World, armed: bool, found: Fuzzing) -> None:
    try:
        robot = build(read)
        for problem in idle(robot):
            found.note(odd, problem)
        if armed:
            found.tried[walk(robot)] += 1
            for problem in idle(robot):
                found.note(odd, f"after disarming: {problem}")
    except Exception as problem:  # noqa: BLE001
        place = problem.__traceback__
        while place is not None and place.tb_next is not None:
            place = place.tb_next
        where = f"{Path(place.tb_frame.f_code.co_filename).name}, line {place.tb_lineno}" if place else ""
        found.note(odd, f"accepted, then {type(problem).__name__}: {problem} ({where})")


def build(read: Configuration | World) -> Lockstep:
    if isinstance(read, Configuration):
        return Lockstep(read, TRACK)
    configuration = load_example()
    return Lockstep(configuration, read.track, plant=read.plant(configuration), drives=read.drives(configuration))


def idle(robot: Lockstep) -> list[str]:
    """What is wrong with a robot that nobody armed, or not any more."""
    if robot.loop.mode in ENERGISED:
        robot.loop.request(Request.DISARM, robot.now_s)
        robot.step()
    beside = [port_beside(robot, bus) for bus in robot.loop.configuration.bus]
    for _ in range(IDLE_TICKS):
        robot.step()
    sent = [frame for port in beside for frame in port.receive() if is_ours(frame) and is_forbidden(frame)]
    problems = [f"sent 0x{frame.arbitration_id:03x} {frame.data.hex(' ')}" for frame in sent[:3]]
    if robot.loop.mode in ENERGISED or any(robot.loop.sent.torques_nm):
        problems.append(f"is in mode {robot.loop.mode.name} with torques {robot.loop.sent.torques_nm}")
    return problems


def walk(robot: Lockstep) -> str:
    """How far it comes."""
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


def report_of(found: Fuzzing, seed: int) -> dict[str, Any]:
    clean = not found.bugs
    return {
        "configurations": sum(found.kinds.values()),
        "seed": seed,
        "kinds": dict(found.kinds),
        "accepted": {kind: found.accepted[kind] for kind in found.kinds},
        "accepted_share": round(sum(found.accepted.values()) / max(1, sum(found.kinds.values())), 3),
        "tried": dict(found.tried),
        "longest_ms": round(1e3 * found.longest_s, 1),
        "longest_kind": found.longest_kind,
        "most_kib": found.most_kib,
        "bugs": len(found.bugs),
        "first_bugs": found.bugs[:20],
        "reached": clean,
        "verdict": verdict("refused with sentences or accepted and working, within 1 s and 64 MiB each", clean),
    }


def text_of(report: dict[str, Any]) -> str:
    lines = [
        f"{kind:15} {count:6} files, {report['accepted'][kind]:6} accepted" for kind, count in report["kinds"].items()
    ]
    lines += [f"{what:18} {count}" for what, count in report["tried"].items()]
    lines.append(f"longest {report['longest_ms']:.0f} ms ({report['longest_kind']}), most {report['most_kib']:.0f} KiB")
    return "\n".join([*lines, *report["first_bugs"]])


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    count = options.configurations
    return report_of(fuzz(count, options.seed, folder, Progress(count)), options.seed)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.stress.configuration_fuzz", __doc__)
    parser.add_argument("--configurations", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    return run_benchmark(parser, arguments, measure, text_of)


if __name__ == "__main__":
    sys.exit(main())
