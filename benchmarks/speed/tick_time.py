"""How long one whole tick takes while the robot walks, and where that time goes.

The simulated robot walks the paper's track adaptively, in step with the daemon's own loop, with four drives on two
buses. The robot computes between the ticks and outside of every figure; no tick waits for a deadline, so processor
and caches are warmer than on a robot (benchmarks.speed.loop_jitter shows ticks that begin asleep). Five kinds of
buses carry the frames: python-can's in-process `virtual` interface, our mock bus without python-can, the local bus's
sockets, and SocketCAN on pairs of sockets, by the socket's own frames and by python-can's send and recv.

Blocks of 1 s alternate between whole ticks and ticks marked at the beginning of every stage. The cost of marking is
measured and taken off each stage; whole ticks carry one reading of the clock.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from benchmarks.example_robot import load_example
from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from benchmarks.speed.timed_walk import TimedWalk
from benchmarks.speed.wirings import VARIANTS, make_wiring
from firmware_host.log.recorder import Recorder

BAR_US = 200.0


def measure(variant: str, seconds: int, progress: Progress, done: int) -> dict[str, Any]:
    configuration = load_example()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mudskipper-")))
        wiring = make_wiring(variant, configuration.bus, folder)
        for port in (*wiring.robot.values(), *wiring.loop.values()):
            stack.callback(port.close)
        recorder = Recorder(folder / "walk.mcap", configuration.text, {})
        stack.callback(recorder.close, timeout_s=10.0)
        walk = TimedWalk(configuration, wiring, recorder)
        progress.show(done, f"{variant} bus, warming up")
        walk.warm_up()
        for second in range(seconds):
            progress.show(done + second, f"{variant} bus")
            walk.run_blocks()
        return walk.report()


def measure_all(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """The verdict is that of the virtual bus where it was measured, and of the first one otherwise."""
    variants, seconds = options.bus or list(VARIANTS), options.seconds
    progress = Progress(len(variants) * seconds)
    measured = {variant: measure(variant, seconds, progress, place * seconds) for place, variant in enumerate(variants)}
    bus = "virtual" if "virtual" in measured else variants[0]
    report = {"seconds": seconds, "variants": measured, "bar_us": BAR_US}
    reached = measured[bus]["whole_us"]["median"] <= BAR_US
    return evaluated(report, f"median whole tick over the {bus} bus at most {BAR_US:.0f} us", reached)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.speed.tick_time", __doc__)
    parser.add_argument("--seconds", type=int, default=20, help="of simulated walking behind each figure")
    parser.add_argument("--bus", action="append", choices=VARIANTS, help="measure only this one; repeatable")
    return run_benchmark(parser, arguments, measure_all)


if __name__ == "__main__":
    sys.exit(main())
