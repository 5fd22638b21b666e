"""How many times faster than real time the simulated robot walks in lockstep with the daemon's loop.

One thread, thus one core: plant, four simulated drives, every frame encoded and decoded over the mock bus, and whole
ticks of the loop without a recorder. The robot walks the paper's track adaptively from end to end, for `--longest`
simulated seconds at most; arming is not counted. The figure of a round is simulated time over elapsed time.
`processor_times` divides by the time of the processor instead, which other programs hardly lengthen.
"""

import sys
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

from control.controller import WalkOrder
from firmware_host.software_version import is_compiled
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from verification.benchmark import Report, evaluated, measure_in_turns, run_benchmark
from verification.example_robot import load_example

BARS_TIMES = {False: 8.0, True: 20.0}  # interpreted, and compiled


def walk_once(longest_s: float) -> Report:
    configuration, track = load_example(), paper_track()
    walk = Lockstep(configuration, track)
    walk.arm()
    walk.walk(WalkOrder(configuration.adaptation.initial_depth_m))
    begin_s, start_s, computed_s = walk.now_s, perf_counter(), process_time()
    arrived = walk.run_until(lambda: walk.robot.plant.body_m >= track.length_m, longest_s)
    elapsed_s, computed_s, simulated_s = perf_counter() - start_s, process_time() - computed_s, walk.now_s - begin_s
    return {
        "times": round(simulated_s / elapsed_s, 2),
        "processor_times": round(simulated_s / computed_s, 2),
        "simulated_s": round(simulated_s, 2),
        "elapsed_s": round(elapsed_s, 3),
        "arrived": arrived,
    }


def measure(folder: Path, *, rounds: int = 5, longest: float = 300.0) -> Report:
    walks = measure_in_turns({"walking": lambda: walk_once(longest)}, rounds)["walking"]
    times, compiled = median(walk["times"] for walk in walks), is_compiled()
    bar_times = BARS_TIMES[compiled]
    report = {"rounds": walks, "median_times": times, "bar_times": bar_times, "compiled": compiled}
    return evaluated(report, f"at least {bar_times:g} times faster than real time", times >= bar_times)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
