"""What viewers cost the loop: its ticks and lateness in a walk, with and without them, in turns of one run.

The viewers are `mudskipper watch` on a terminal, `mudskipper live`, and three clients of it that subscribe to every
channel. The daemon and the simulated robot are processes of their own, as are all viewers, and all share this machine.
A turn with viewers begins once they have settled, and a ratio is that of pairs of turns. A tick contains the serving of
clients. With `--viewers ros2` they are `mudskipper ros2`, a Zenoh router and three subscribers to all topics.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from verification.benchmark import Report, evaluated, measure_in_turns, paired_ratio, run_benchmark
from verification.local_robot import LocalRobot
from verification.speed.ros_viewers import start_ros_viewers
from verification.speed.stream_viewers import cpu_s, start_stream_viewers

BAR_RATIO = 1.03
BAR_CPU = 0.05  # of a processor, for the screen or `mudskipper ros2`
Start = Callable[[Path], list[subprocess.Popen[bytes]]]
KINDS: dict[str, Start] = {"screen": start_stream_viewers, "ros2": start_ros_viewers}
SETTLING_S = 5.0  # the screen's libraries take a second or two
FIGURES = [(name, part) for name in ("tick_us", "wake_late_us") for part in ("p50", "p99")]


def time_turn(robot: LocalRobot, seconds: float) -> Report:
    """Return the loop's timing over that time of walking. Raises RuntimeError where the robot does not walk."""
    robot.call("reset_timing")
    time.sleep(seconds)
    report: Report = robot.call("status")
    if report["mode"] != "walking":
        raise RuntimeError(f"the simulated robot does not walk: {report['notice'] or report['fault']}")
    timing: Report = report["loop"]
    return timing


def time_turn_with_viewers(robot: LocalRobot, seconds: float, start: Start) -> Report:
    viewers = start(robot.socket)
    try:
        time.sleep(SETTLING_S)
        before_s, begun_s = cpu_s(viewers[0]), time.monotonic()
        turn = time_turn(robot, seconds)
        cpu = (cpu_s(viewers[0]) - before_s) / (time.monotonic() - begun_s)
        return turn | {"viewer_cpu": round(cpu, 4), "all_run": all(each.poll() is None for each in viewers)}
    finally:
        for process in reversed(viewers):
            process.kill()
            process.wait()


def measure(folder: Path, *, seconds: float = 10.0, pairs: int = 8, viewers: str = "screen") -> Report:
    if viewers not in KINDS:
        raise SystemExit(f"--viewers {viewers}: must be one of {', '.join(KINDS)}")
    robot = LocalRobot(folder)
    try:
        robot.start_daemon()
        robot.require_walk()
        turns = {
            "without": lambda: time_turn(robot, seconds),
            "with": lambda: time_turn_with_viewers(robot, seconds, KINDS[viewers]),
        }
        measured = measure_in_turns(turns, pairs)
    finally:
        robot.end()
    report: Report = {}
    for name, part in FIGURES:
        figures = {turn: [max(1.0, each[name][part]) for each in own] for turn, own in measured.items()}
        medians = {turn: median(each) for turn, each in figures.items()}
        report[f"{name}_{part}"] = medians | paired_ratio(figures["with"], figures["without"])
    report |= {
        "viewer_cpu": median(turn["viewer_cpu"] for turn in measured["with"]),
        "missed_ticks": {name: sum(turn["missed_ticks"] for turn in each) for name, each in measured.items()},
        "pairs": pairs,
        "all_run": all(turn["all_run"] for turn in measured["with"]),
    }
    worst = max(report[f"{name}_p50"]["ratio"] for name in ("tick_us", "wake_late_us"))
    reached = worst <= BAR_RATIO and report["viewer_cpu"] <= BAR_CPU and report["all_run"]
    bar = f"medians of tick and lateness at most {BAR_RATIO:g} times those without, its program at most {BAR_CPU:.0%}"
    return evaluated(report, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
