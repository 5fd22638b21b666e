"""How many times faster than real time the simulated robot walks in lockstep with the daemon's loop.

One thread, thus one core: plant, four simulated drives, every frame encoded and decoded over the mock bus, and whole
ticks of the loop without a recorder. The robot walks the paper's track adaptively from end to end, for `--longest`
simulated seconds at most; arming is not counted. The figure of a round is simulated time over elapsed time.
`processor_times` divides by the time of the processor instead, which other programs hardly lengthen. In turns the same
robot walks without buses and frames; `direct_ratio` says how many times faster, by the time of the processor. A bare
loop over floats takes a turn too: `million_turns` of it take as long as one simulated second, which hardly depends on
the computer.
"""

import sys
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

from control.controller import WalkOrder
from firmware_host.software_version import is_compiled
from simulation.harness.direct import Direct
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from verification.benchmark import Report, evaluated, measure_in_turns, run_benchmark
from verification.example_robot import load_example

BARS_TIMES = {False: 8.0, True: 20.0}  # interpreted, and compiled


def walk_once(kind: type[Lockstep], longest_s: float) -> Report:
    configuration, track = load_example(), paper_track()
    walk = kind(configuration, track)
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


def turn_bare_loop() -> Report:
    """Return the processor's time of a million turns, from three million."""
    start_s, total = process_time(), 0.0
    for number in range(3_000_000):
        total += number * 0.5
    return {"million_turns_s": (process_time() - start_s) / 3.0}


def measure(folder: Path, *, rounds: int = 5, longest: float = 300.0) -> Report:
    kinds = {"walking": partial(walk_once, Lockstep, longest), "direct": partial(walk_once, Direct, longest)}
    measured = measure_in_turns(kinds | {"bare": turn_bare_loop}, rounds)
    walks, compiled = measured["walking"], is_compiled()
    times, bar_times = median(walk["times"] for walk in walks), BARS_TIMES[compiled]
    direct, other = (median(walk["processor_times"] for walk in measured[kind]) for kind in ("direct", "walking"))
    bare_s = median(turns["million_turns_s"] for turns in measured["bare"])
    report = {
        "rounds": walks,
        "median_times": times,
        "direct_ratio": round(direct / other, 2),
        "million_turns": round(1.0 / (other * bare_s), 2),
        "bar_times": bar_times,
        "compiled": compiled,
    }
    return evaluated(report, f"at least {bar_times:g} times faster than real time", times >= bar_times)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
