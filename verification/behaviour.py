"""Checks that a refactoring keeps the robot's behaviour: record everything before it and after it, then compare.

`record DIR` writes the replay of every measured log by each method, Table I by trial, the fault matrix, the other
simulated experiments, the rows that a lockstep walk logs, and the socket's answers during that walk. All of it is
deterministic, so `compare OLD NEW` accepts no difference in any digit but those of `provenance`, the version and its
sources. A name that changed on purpose is given as `--renamed OLD=NEW`, a value that must differ as `--ignore NAME`.

    python -m verification.behaviour record /tmp/new
    python -m verification.behaviour compare /tmp/old /tmp/new --renamed place_m=position_m
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from os import cpu_count, environ
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from firmware_host.log.rows import ROW_KINDS
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.rpc import RefusedError
from firmware_host.sockets.socket_methods import Level
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from verification.example_robot import load_example
from verification.faults.failing_robot import RowList

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
DIFFERENCES_SHOWN = 12  # of one file
SIMULATED: dict[str, tuple[str, ...]] = {
    "trackway": ("--trials", "2", "--method", "default", "--method", "paper", "--method", "gait"),
    "faults": (),
    "estimation": ("--seeds", "1"),
    "sweep": ("--seeds", "1", "--strength", "1000", "--strength", "3000"),
    "flipper": ("--trials", "1"),
    "walk": ("--trials", "1"),
    "loadcell": ("--trials", "2"),
    "actuator": ("--trials", "2", "--seed", "1"),
}

# Requests to the robot, accepted and refused ones, and for how long it then runs.
QUERIES = ("hello", "status", "check", "map", "strides")
REFUSED: tuple[tuple[str, dict[str, Any]], ...] = (
    ("walk", {"strides": 3}),
    ("move", {"left_sweep_rad": 0.1}),
    ("arm", {"force": 1}),
    ("walk", {"depth_m": 9.0}),
    ("walk", {"strides": -1}),
    ("lease", {"for_s": 99}),
    ("walk", {"depth_m": "deep"}),
)
SCHEDULE: tuple[tuple[tuple[tuple[str, dict[str, Any]], ...], float], ...] = (
    ((), 1.0),
    (REFUSED, 0.0),
    ((("arm", {}),), 1.5),
    ((("lease", {"for_s": 5.0}), ("move", {"left_sweep_rad": 9.0}), ("move", {}), ("move", {"sweep": 1})), 0.0),
    ((("move", {"right_adduction_rad": 0.5}),), 3.0),
    ((("release", {}), ("walk", {"strides": 6})), 8.0),
    ((), 8.0),
    ((("stop", {}),), 3.0),
    ((("walk", {"depth_m": 0.05, "strides": 12}),), 12.0),
    ((), 20.0),
    ((("stop", {}),), 3.5),
    ((("clear", {}), ("disarm", {})), 1.0),
    ((("reset_timing", {}),), 0.5),
)


def record_lockstep(folder: Path) -> None:
    """Operate one robot by SCHEDULE and writes its rows and every answer."""
    rows = RowList()
    robot = Lockstep(load_example(), paper_track(), seed=3, recorder=rows)
    methods = OperatorCalls(robot.loop, [], lambda: robot.now_s).methods
    caller = Caller(0, Peer(0, 0, frozenset()), Level.DRIVE)
    answers = []
    for requests, run_s in SCHEDULE:
        calls = (*requests, *((name, {}) for name in QUERIES))
        for name, params in calls:
            try:
                answer = methods[name](dict(params), caller)
            except RefusedError as refusal:
                answer = {"refused": str(refusal)}
            answers.append({"method": name, "params": params, "answer": answer})
        robot.run_for(run_s)
    decoded = [{"topic": ROW_KINDS[kind].topic} | ROW_KINDS[kind].decode(row) for kind, row in rows.rows]
    _write(folder / "lockstep_rows.json", decoded)
    _write(folder / "lockstep_answers.json", answers)


def commands_of(data: Path, results: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the name and the arguments of every recorded command."""
    for path in sorted(data.glob("flipper_in_mud/*.csv.gz")):
        for method in ("default", "paper"):
            yield f"replay_{path.name.split('.csv')[0]}_{method}", ["replay", str(path), "--json", "--method", method]
    for name, options in SIMULATED.items():
        yield name, ["experiment", name, "--simulated", "--json", *options, "--out", str(results / name)]


def record_command(folder: Path, name: str, arguments: Sequence[str]) -> None:
    command = [sys.executable, "-m", "command_line.main", *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    report = None
    with suppress(ValueError):
        report = json.loads(done.stdout)
    _write(folder / f"{name}.json", {"status": done.returncode, "report": report})
    print(f"{name}: exit status {done.returncode}", flush=True)


def record(folder: Path, data: Path, only: Sequence[str]) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    if not only or "lockstep" in only:
        record_lockstep(folder)
    with TemporaryDirectory(prefix="mudskipper-") as results, ThreadPoolExecutor(cpu_count()) as pool:
        wanted = [
            (name, arguments)
            for name, arguments in commands_of(data, Path(results))
            if not only or name.split("_")[0] in only
        ]
        list(pool.map(lambda each: record_command(folder, *each), wanted))
    return 0


def _write(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=0, sort_keys=True, default=str) + "\n", encoding="utf-8")


def differences(old: Any, new: Any, names: Mapping[str, str], ignored: frozenset[str], path: str = "") -> Iterator[str]:
    """Yield every value that is missing, added or changed, by its path. `names`: new names by the old ones."""
    if isinstance(old, dict) and isinstance(new, dict):
        old = {name if name in new else names.get(name, name): value for name, value in old.items()}
        for name in sorted((old.keys() | new.keys()) - ignored):
            if name in new and name in old:
                yield from differences(old[name], new[name], names, ignored, f"{path}.{name}")
            else:
                yield f"{path}.{name}: {'added' if name in new else 'missing'}"
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield f"{path}: {len(new)} entries, before {len(old)}"
        for number, (before, after) in enumerate(zip(old, new, strict=False)):
            yield from differences(before, after, names, ignored, f"{path}[{number}]")
    elif repr(old) != repr(new):  # 1 differs from 1.0, and NaN equals NaN
        yield f"{path}: {new!r}, before {old!r}"


def compare(old: Path, new: Path, names: dict[str, str], ignored: frozenset[str]) -> int:
    """Print the differences of each file; return 0 where there are files and none differs."""
    files = sorted({path.name for folder in (old, new) for path in folder.glob("*.json")})
    failed = not files
    for file in files:
        if missing := [folder for folder in (old, new) if not (folder / file).exists()]:
            print(f"{file}: not in {missing[0]}")
            failed = True
            continue
        before, after = (json.loads((folder / file).read_text(encoding="utf-8")) for folder in (old, new))
        found = list(differences(before, after, names, ignored))
        failed |= bool(found)
        print(f"{file}: {f'{len(found)} differences' if found else 'identical'}")
        print("".join(f"  {line}\n" for line in found[:DIFFERENCES_SHOWN]), end="")
    return 1 if failed else 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    actions = parser.add_subparsers(dest="action", required=True)
    recording = actions.add_parser("record", help="write what this version does")
    recording.add_argument("folder", type=Path)
    data = Path(environ.get("MUDSKIPPER_SHARED_DATA", SHARED_DATA))
    recording.add_argument("--data", type=Path, default=data, help="folder of the measured logs")
    recording.add_argument("--only", action="append", default=[], help="lockstep, replay or an experiment; repeatable")
    comparing = actions.add_parser("compare", help="two such folders")
    comparing.add_argument("old", type=Path)
    comparing.add_argument("new", type=Path)
    comparing.add_argument("--renamed", action="append", default=[], metavar="OLD=NEW")
    comparing.add_argument("--ignore", action="append", default=[], metavar="NAME")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    options = _options(arguments)
    if options.action == "record":
        return record(options.folder, options.data, options.only)
    names = dict(pair.split("=", 1) for pair in options.renamed)
    return compare(options.old, options.new, names, frozenset({"provenance", *options.ignore}))


if __name__ == "__main__":
    sys.exit(main())
