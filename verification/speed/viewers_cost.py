"""What viewers cost the loop: its ticks and lateness in a walk, with and without them, in turns of one run.

The viewers are `mudskipper watch` on a terminal, `mudskipper live`, and three clients of it that subscribe to every
channel. The daemon and the simulated robot are processes of their own, as are all viewers, and all share this machine.
A turn with viewers begins once they have settled; each has a turn without them next to it, and a ratio is the median
over these pairs. A tick contains the serving of clients.
"""

import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

from verification.local_robot import LocalRobot
from verification.report import evaluated, run_benchmark, show_progress
from verification.speed.stream_viewers import Viewers, cpu_s

BAR_RATIO = 1.03
BAR_SCREEN = 0.05  # of a processor
SETTLING_S = 5.0  # the screen's libraries take a second or two
FIGURES = [(name, part) for name in ("tick_us", "wake_late_us") for part in ("p50", "p99")]
Turn = dict[str, Any]


def time_turn(robot: LocalRobot, seconds: float) -> Turn:
    """Returns the loop's timing over that time of walking. Raises RuntimeError where the robot does not walk."""
    robot.call("reset_timing")
    time.sleep(seconds)
    report: Turn = robot.call("status")
    if report["mode"] != "walking":
        raise RuntimeError(f"the simulated robot does not walk: {report['notice'] or report['fault']}")
    timing: Turn = report["loop"]
    return timing


def time_turn_with_viewers(robot: LocalRobot, seconds: float) -> Turn:
    viewers = Viewers(robot.socket)
    try:
        time.sleep(SETTLING_S)
        before_s, begun_s = cpu_s(viewers.watch), time.monotonic()
        turn = time_turn(robot, seconds)
        screen = (cpu_s(viewers.watch) - before_s) / (time.monotonic() - begun_s)
        return turn | {"screen_cpu": round(screen, 4), "all_run": viewers.all_run}
    finally:
        viewers.end()


def summary_of(without: list[Turn], with_viewers: list[Turn]) -> dict[str, Any]:
    summary: dict[str, Any] = {}
    for name, part in FIGURES:
        alone, viewed = ([turn[name][part] for turn in turns] for turns in (without, with_viewers))
        ratio = median(b / max(a, 1.0) for a, b in zip(alone, viewed, strict=True))
        summary[f"{name}_{part}"] = {"without": median(alone), "with": median(viewed), "ratio": round(ratio, 3)}
    return summary


def measure(folder: Path, *, seconds: float = 10.0, pairs: int = 8) -> dict[str, Any]:
    robot = LocalRobot(folder)
    without, with_viewers = [], []
    try:
        robot.start_daemon()
        robot.require_walk()
        for number in range(pairs):
            show_progress(number, pairs, "without viewers")
            without.append(time_turn(robot, seconds))
            show_progress(number + 0.4, pairs, "with viewers")
            with_viewers.append(time_turn_with_viewers(robot, seconds))
    finally:
        robot.end()
    report = summary_of(without, with_viewers)
    screen = median(turn["screen_cpu"] for turn in with_viewers)
    turns_of = {"without": without, "with": with_viewers}
    missed = {name: sum(turn["missed_ticks"] for turn in turns) for name, turns in turns_of.items()}
    worst = max(report[f"{name}_p50"]["ratio"] for name in ("tick_us", "wake_late_us"))
    all_run = all(turn["all_run"] for turn in with_viewers)
    reached = worst <= BAR_RATIO and screen <= BAR_SCREEN and all_run
    bar = f"medians of tick and lateness at most {BAR_RATIO:g} times those without, the screen at most {BAR_SCREEN:.0%}"
    return evaluated(
        report | {"screen_cpu": screen, "missed_ticks": missed, "pairs": pairs, "all_run": all_run}, bar, reached
    )


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
