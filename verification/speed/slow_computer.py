"""Whether the robot walks without a missed tick on a computer that is slower than this one by a factor.

The simulated robot walks the paper's track adaptively over pairs of sockets, in lockstep with the daemon's own loop and
with a log. The same walk runs `--walks` times. A walk is deterministic, so tick n does the same work in each of them:
the shortest of its durations is that work, and the rest is noise of this computer. Durations are in time of the
processor, which excludes other programs. Ticks do not contain the serving of clients; tick_time measures that.

The robot then walks once for each factor with these durations times the factor: loop and ticker read a clock that runs
accordingly (scaled_clock.py), so a late tick has its effect on the robot. `slow` counts the ticks that take more than a
period: `end` has those after an insertion or an extraction, in which strides are fitted and closed, `elsewhere` the
others. `skipped` are the deadlines that passed without a tick. `largest_factor` is a period divided by the longest
tick: up to it no tick takes longer than a period. `--picture FILE` draws the ticks of the first strides; it needs
matplotlib.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from control.controller import WalkOrder
from control.modes import Mode
from control.rate import PERIOD_S
from firmware_host.computer.realtime import freeze_garbage
from simulation.mud.track import paper_track
from verification.example_robot import load_example
from verification.report import evaluated, run_benchmark, show_progress
from verification.speed.tick_pictures import plot_ticks, require_matplotlib
from verification.walks.scaled_clock import RecordedWork, ScaledClock, ScaledWalk
from verification.walks.walk_ticks import BeforeTick, WalkTick, least_work, walk_ticks
from verification.walks.wired_walk import open_wiring, wire

OTHER_FACTOR = 2.5  # with the one that is asked for, the range of a Raspberry Pi and a Jetson


def walk_once(
    folder: Path, seconds: float, clock: ScaledClock, before_tick: BeforeTick
) -> tuple[ScaledWalk, list[WalkTick]]:
    """Returns the walk at its end, and its ticks."""
    folder.mkdir(parents=True)
    configuration = load_example()
    with open_wiring("socketcan", configuration, folder) as (wiring, recorder):
        walk = ScaledWalk(configuration, paper_track(), clock)
        wire(walk, configuration, wiring, recorder)
        walk.arm()
        walk.walk(WalkOrder(configuration.adaptation.initial_depth_m))
        freeze_garbage()
        return walk, walk_ticks(walk, round(seconds / PERIOD_S), before_tick)


def measure_work(folder: Path, seconds: float, walks: int) -> list[WalkTick]:
    """Returns the ticks of a walk, each with its shortest duration. Raises RuntimeError where walks differ or end."""
    measured = []
    for number in range(walks):
        show_progress(number, walks, "the same walk again")
        walk, ticks = walk_once(folder / str(number), seconds, ScaledClock(0.0), lambda span, index: None)
        if walk.loop.mode is not Mode.WALKING:
            raise RuntimeError(f"the robot does not walk any more: {walk.loop.fault}")
        measured.append(ticks)
    return least_work(measured)


def walk_slowly(folder: Path, ticks: Sequence[WalkTick], factor: float) -> dict[str, Any]:
    """Walks with the recorded work times the factor; a tick that the recorded walk lacks takes the median."""
    works_s, usual_s, work = {tick[:2]: tick.worked_s for tick in ticks}, median_s(ticks), RecordedWork()

    def before_tick(span: int, index: int) -> None:
        work.next_s = works_s.get((span, index), usual_s)

    clock = ScaledClock(factor, work)
    walk, walked = walk_once(folder / f"{factor:g}", len(ticks) * PERIOD_S, clock, before_tick)
    late = [tick.at_end for tick in walked if factor * tick.worked_s > PERIOD_S]
    skipped = walk.loop.timing.missed_ticks
    return {
        "end": sum(late),
        "elsewhere": len(late) - sum(late),
        "skipped": skipped,
        "mode": walk.loop.mode.name.lower(),
    }


def median_s(ticks: Sequence[WalkTick]) -> float:
    return median(tick.worked_s for tick in ticks)


def longest_s(ticks: Sequence[WalkTick], at_end: bool) -> float:
    return max((tick.worked_s for tick in ticks if tick.at_end is at_end), default=0.0)


def largest_factor(ticks: Sequence[WalkTick], at_end: bool) -> float | None:
    """Returns the factor at which the longest of these ticks takes a period; None where there is no such tick."""
    longest = longest_s(ticks, at_end)
    return PERIOD_S / longest if longest > 0.0 else None


def summary_of(ticks: Sequence[WalkTick]) -> dict[str, Any]:
    kinds = {"end": True, "elsewhere": False}
    largest = {name: largest_factor(ticks, at_end) for name, at_end in kinds.items()}
    longest_us = {name: 1e6 * longest_s(ticks, at_end) for name, at_end in kinds.items()}
    median_us = 1e6 * median_s(ticks)
    return {
        "ticks": {name: sum(tick.at_end is at_end for tick in ticks) for name, at_end in kinds.items()},
        "median_us": round(median_us, 1),
        "longest_us": {name: round(each_us, 1) for name, each_us in longest_us.items()},
        "longest_to_median": {name: round(each_us / median_us, 2) for name, each_us in longest_us.items()},
        "largest_factor": {name: factor and round(factor, 2) for name, factor in largest.items()},
    }


def measure(
    folder: Path, *, factor: float = 5.0, walks: int = 5, seconds: float = 20.0, picture: str = ""
) -> dict[str, Any]:
    if seconds < PERIOD_S:
        raise SystemExit(f"--seconds {seconds:g}: must be at least {PERIOD_S:.4f}, the period of a tick")
    if picture:
        require_matplotlib()
    ticks = measure_work(folder, seconds, walks)
    if picture:
        plot_ticks(ticks, factor, Path(picture))
    slow = {f"{each:g}": walk_slowly(folder / "slow", ticks, each) for each in sorted({OTHER_FACTOR, factor})}
    report = {"factor": factor, "walks": walks, "seconds": seconds} | summary_of(ticks) | {"slow": slow}
    reached = slow[f"{factor:g}"]["end"] == 0
    return evaluated(report, f"no missed tick at a stride's end with factor {factor:g}", reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
