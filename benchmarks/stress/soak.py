"""A long operation without growth: an hour in accelerated lockstep, and minutes of the daemon in real time.

A random operator works with the robot, parts of it fail at random, and clients come and go; see soaked_loop.py and
soaked_daemon.py. After the warm-up (the loop keeps its last 200 strides, Python its free lists, each up to a bound)
resident memory must not grow by more than the bar, every descriptor and thread must be released, the logs must stay
within quota plus the file that is being written, and the files that the quota has preserved must contain every tick.
Nothing traces allocations; a collection at the end counts the cyclic garbage.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from benchmarks.stress.soaked_daemon import soak_daemon
from benchmarks.stress.soaked_loop import soak_loop

BAR_KIB = 1024.0
WARM_UP_FRACTION = 0.2  # of the readings


def evaluated_part(part: dict[str, Any]) -> dict[str, Any]:
    """Adds the growth after the warm-up, and whether the part is sound."""
    after = part["readings"][int(WARM_UP_FRACTION * len(part["readings"])) :]
    growth_kib = after[-1]["resident_kib"] - after[0]["resident_kib"]
    left = {name: after[-1][name] - after[0][name] for name in ("descriptors", "threads", "writer_descriptors")}
    largest_log = max(reading["log_bytes"] for reading in part["readings"])
    sound = not (part["bugs"] or part["dropped"] or part["ticks_missing"] or part["files_not_whole"])
    sound = sound and growth_kib < BAR_KIB and max(left.values()) <= 0 and largest_log <= part["quota_bytes"]
    return part | {"growth_kib": growth_kib, "left": left, "largest_log_bytes": largest_log, "sound": sound}


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    parts: dict[str, dict[str, Any]] = {}
    for name, seconds, soak in (
        ("real_time", 60.0 * options.real_time_minutes, soak_daemon),
        ("lockstep", 3600.0 * options.hours, soak_loop),
    ):
        if seconds > 0.0:
            (folder / name).mkdir()
            parts[name] = evaluated_part(soak(seconds, options.seed, folder / name, Progress(seconds)))
    bar = f"growth below {BAR_KIB:.0f} KiB, nothing left over, no row lost, logs within their quota"
    report = {"seed": options.seed, "bar_kib": BAR_KIB, "parts": list(parts)} | parts
    return evaluated(report, bar, all(part["sound"] for part in parts.values()))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.stress.soak", __doc__)
    parser.add_argument("--hours", type=float, default=1.0, help="simulated, in lockstep; 0: none")
    parser.add_argument("--real-time-minutes", type=float, default=0.0, metavar="MINUTES", help="of the daemon")
    parser.add_argument("--seed", type=int, default=1)
    return run_benchmark(parser, arguments, measure)


if __name__ == "__main__":
    sys.exit(main())
