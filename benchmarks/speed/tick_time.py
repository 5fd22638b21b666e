"""How long one whole tick takes while the robot walks, and where that time goes.

The simulated robot walks the paper's track adaptively, in step with the daemon's own loop, with four drives on two
buses. The robot computes between the ticks and outside of every figure; no tick waits for a deadline, so processor
and caches are warmer than on a robot (benchmarks.speed.loop_jitter shows ticks that begin asleep). Five kinds of
buses carry
the frames: python-can's in-process `virtual` interface, our mock bus without python-can, the local bus's sockets, and
SocketCAN on pairs of sockets by both of its paths, which benchmarks/speed/can_paths.py also compares
alone.

Blocks of 1 s alternate between whole ticks, ticks marked at the beginning of every stage, and marked ticks without
a recorder. What marking costs is measured and taken off each stage; whole ticks carry one reading of the clock.
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
from benchmarks.report import Progress, evaluated, new_parser, run_benchmark, verdict
from benchmarks.speed.can_paths import BAR_RATIO, compare_paths
from benchmarks.speed.stage_marks import MEANINGS
from benchmarks.speed.timed_walk import TimedWalk
from benchmarks.speed.wirings import VARIANTS
from experiments.reports.text_tables import table
from firmware_host.log.recorder import Recorder

BAR_US = 200.0


def measure(variant: str, seconds: int, progress: Progress, done: int) -> dict[str, Any]:
    configuration = load_example()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mudskipper-")))
        wiring = VARIANTS[variant](configuration.bus, folder)
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


def text_of(report: dict[str, Any]) -> str:
    lines = []
    for variant, figures in report["variants"].items():
        frames = f"{figures['frames_received']:.1f} frames in and {figures['frames_sent']:.1f} out per tick"
        marking = f"marking a stage costs {figures['marking_us']:.2f} us, taken off"
        lines += [f"{variant} bus: {frames}; {marking}", table(_rows(figures)), ""]
    paths = report["socketcan"]
    own, python_can = (
        f"{paths['own_us']:.1f} us by the socket's own frames",
        f"{paths['python_can_us']:.1f} by python-can",
    )
    lines.append(f"SocketCAN, reads and sends of a tick: {own}, {python_can}, {paths['ratio']:.2f} times as much")
    lines.append(verdict(f"python-can takes at least {BAR_RATIO:g} times as long", paths["reached"]))
    return "\n".join(lines)


def _rows(figures: dict[str, Any]) -> list[list[str]]:
    whole, closing, adapting = figures["whole_us"], figures["whole_closing_us"], figures["adapt_closing_us"]
    rows = [["us", "median", "p99", "max", ""], _row("whole tick", whole, f"all {whole['ticks']} ticks")]
    rows.append(_row("whole tick, closing", closing, f"{closing['ticks']} ticks that close a stride"))
    rows += [_row(f"  {stage}", figures["stages_us"][stage], meaning) for stage, meaning in MEANINGS.items()]
    rows.append(_row("  adapt, closing", adapting, f"{adapting['ticks']} ticks that choose a depth"))
    rows.append(_row("  record, no recorder", figures["record_unrecorded_us"], "row packing alone"))
    return rows


def _row(name: str, figures: dict[str, float], meaning: str) -> list[str]:
    return [name, *(f"{figures[key]:7.1f}" for key in ("median", "p99", "max")), meaning]


def measure_all(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """The verdict is that of the virtual bus where it was measured, and of the first one otherwise."""
    variants, seconds = options.bus or list(VARIANTS), options.seconds
    progress = Progress(len(variants) * seconds)
    measured = {variant: measure(variant, seconds, progress, place * seconds) for place, variant in enumerate(variants)}
    progress.show(len(variants) * seconds, "both paths to SocketCAN")
    bus = "virtual" if "virtual" in measured else variants[0]
    report = {"seconds": seconds, "variants": measured, "socketcan": compare_paths(), "bar_us": BAR_US}
    reached = measured[bus]["whole_us"]["median"] <= BAR_US
    return evaluated(report, f"median whole tick over the {bus} bus at most {BAR_US:.0f} us", reached)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.speed.tick_time", __doc__)
    parser.add_argument("--seconds", type=int, default=20, help="of simulated walking behind each figure")
    parser.add_argument("--bus", action="append", choices=VARIANTS, help="measure only this one; repeatable")
    return run_benchmark(parser, arguments, measure_all, text_of)


if __name__ == "__main__":
    sys.exit(main())
