"""How many times faster than real time the simulated robot walks in lockstep with the daemon's loop.

One thread, thus one core: plant, four simulated drives, every frame encoded and decoded over the mock bus, and whole
ticks of the loop without a recorder. The robot walks the paper's track adaptively from end to end; arming is not
counted. The figure of a round is simulated time over elapsed time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from benchmarks.example_robot import load_example
from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from control.controller import WalkOrder
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track

BAR_TIMES = 8.0


def walk_once(longest_s: float) -> dict[str, Any]:
    configuration, track = load_example(), paper_track()
    walk = Lockstep(configuration, track)
    walk.arm()
    walk.walk(WalkOrder(configuration.adaptation.initial_depth_m))
    begin_s, start_s = walk.now_s, perf_counter()
    arrived = walk.run_until(lambda: walk.robot.plant.body_m >= track.length_m, longest_s)
    elapsed_s, simulated_s = perf_counter() - start_s, walk.now_s - begin_s
    return {
        "times": round(simulated_s / elapsed_s, 2),
        "simulated_s": round(simulated_s, 2),
        "elapsed_s": round(elapsed_s, 3),
        "arrived": arrived,
    }


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    progress, rounds = Progress(options.rounds), []
    for number in range(options.rounds):
        progress.show(number, "walking")
        rounds.append(walk_once(options.longest))
    times = median(walk["times"] for walk in rounds)
    report: dict[str, Any] = {"rounds": rounds, "median_times": times, "bar_times": BAR_TIMES}
    return evaluated(report, f"at least {BAR_TIMES:g} times faster than real time", times >= BAR_TIMES)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.speed.lockstep_speed", __doc__)
    parser.add_argument("--rounds", type=int, default=5, help="walks, of which the median counts")
    parser.add_argument("--longest", type=float, default=300.0, metavar="SECONDS", help="simulated, of one walk")
    return run_benchmark(parser, arguments, measure)


if __name__ == "__main__":
    sys.exit(main())
