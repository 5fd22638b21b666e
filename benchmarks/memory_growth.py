"""Whether the loop's process grows while it walks: resident memory, every simulated minute of a long walk.

The robot walks adaptively in lockstep over a long track of repeated muds, with garbage collection off as in the
daemon and a real recorder that writes to a temporary folder. The simulated robot lives in the same process, so its
memory is counted too. Growth is what was added after the first reading. The loop keeps its last 200 strides, and
Python's free lists fill up to a bound of their own, so the first minutes grow a little. Memory comes from
/proc/self/statm; nothing traces allocations.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.example_robot import load_example
from benchmarks.report import Progress, new_parser, print_report, verdict
from command_line.screen import table
from control.controller import WalkOrder
from control.modes import Mode
from firmware_host.realtime import freeze_garbage
from firmware_host.recorder import Recorder
from simulation.clay import MUDS
from simulation.lockstep import Lockstep
from simulation.track import Track

BAR_KIB = 1024.0
PAGE_KIB = os.sysconf("SC_PAGE_SIZE") / 1024.0
SEGMENT_M = 3.0
SEGMENTS = 60


def resident_kib() -> float:
    """Of this process, as the kernel counts it."""
    return PAGE_KIB * int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])


def long_track() -> Track:
    muds = list(MUDS.values())
    return Track([(SEGMENT_M, muds[place % len(muds)]) for place in range(SEGMENTS)])


def walk_long(seconds: float, every_s: float, folder: Path, progress: Progress) -> dict[str, Any]:
    configuration = load_example()
    recorder = Recorder(folder / "walk.mcap", configuration.text, {})
    try:
        walk = Lockstep(configuration, long_track(), recorder=recorder)
        walk.arm()
        freeze_garbage()
        walk.walk(WalkOrder(configuration.adaptation.initial_depth_m))
        readings = _readings(walk, seconds, every_s, progress)
        if walk.loop.mode is not Mode.WALKING:
            raise RuntimeError(f"the robot does not walk any more: {walk.loop.fault}")
    finally:
        recorder.close(timeout_s=10.0)
    return {
        "readings": readings,
        "walked_m": round(walk.robot.plant.body_m, 2),
        "strides": walk.loop.learning.strides_closed,
        "dropped_rows": recorder.dropped,
    }


def _readings(walk: Lockstep, seconds: float, every_s: float, progress: Progress) -> list[dict[str, float]]:
    readings = []
    for number in range(1, max(2, round(seconds / every_s)) + 1):
        progress.show((number - 1) * every_s, "walking")
        walk.run_for(every_s)
        readings.append({"walked_s": number * every_s, "resident_kib": resident_kib()})
    return readings


def text_of(report: dict[str, Any]) -> str:
    first_kib = report["readings"][0]["resident_kib"]
    rows = [
        [f"{reading['walked_s']:g}", f"{reading['resident_kib']:.0f}", f"{reading['resident_kib'] - first_kib:+.0f}"]
        for reading in report["readings"]
    ]
    walked = f"{report['walked_m']:.1f} m, {report['strides']} strides of both flippers"
    lines = [table([["walked s", "resident KiB", "growth KiB"], *rows]), ""]
    return "\n".join([*lines, f"{walked}; {report['dropped_rows']} rows dropped", report["verdict"]])


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("memory_growth", __doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="simulated, of the whole walk")
    parser.add_argument("--every", type=float, default=60.0, metavar="SECONDS", help="simulated, between readings")
    options = parser.parse_args(arguments)
    progress = Progress(options.seconds)
    with tempfile.TemporaryDirectory(prefix="mudskipper-") as folder:
        measured = walk_long(options.seconds, options.every, Path(folder), progress)
    progress.clear()
    readings_kib = [reading["resident_kib"] for reading in measured["readings"]]
    growth_kib = readings_kib[-1] - readings_kib[0]
    reached = growth_kib < BAR_KIB
    bar = f"growth after the first reading below {BAR_KIB:.0f} KiB"
    report: dict[str, Any] = {"benchmark": "memory_growth"} | measured | {"growth_kib": growth_kib}
    report |= {"bar_kib": BAR_KIB, "reached": reached, "verdict": verdict(bar, reached)}
    print_report(report, text_of(report), options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
