"""Runs `mudskipper demo`: the real daemon against a simulated robot, in real time, over three muds.

It uses the interfaces that operators and their programs use, and ends with a summary, a plot and the log.
"""

import os
import signal
import sys
import time
from contextlib import redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np

from command_line import exit_codes
from command_line.errors import CommandError, missing_library
from command_line.json_output import Answer
from command_line.robot_text import Report, machine_lines
from command_line.screen import STRIDE_HEAD, STRIDE_UNITS, complain, stride_line
from command_line.shared_options import Json, Seed
from control.modes import Mode
from experiments.reports.counted_nouns import counted
from experiments.reports.mud_names import mud_text
from experiments.study.option import Option
from experiments.study.values import folder
from firmware_host.log.log_folder import DONE, log_files, present_path
from logs.files.log_reader import read_log
from mudskipper.client import POLL_S, Client
from mudskipper.simulated_robot import ready_client
from operator_client.status_client import CallRefusedError, NoDaemonError
from simulation.harness.local_robot import LocalRobot
from simulation.harness.world import load_world
from simulation.mud.track import Track, paper_track

LONGEST_WALK_S = 60.0
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FINISH_M = 0.02  # before the end of the track
LEAD_M = 0.06  # distance of the flippers ahead of the body's middle when a stride begins


def demo(
    *,
    json: Json = False,
    out: Annotated[Path, Option("for log and plot", metavar="DIR", parse=folder)] = Path("mudskipper-demo"),
    seed: Seed = 1,
    depth: Annotated[
        float | None, Option("fixed insertion depth (default: adaptive)", unit="cm", low=0.5, high=20.0)
    ] = None,
    world: Annotated[Path | None, Option("describes the ground (default: three muds)")] = None,
) -> Answer:
    for number in ENDING_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # ignored by nohup
            signal.signal(number, _interrupt)
    track = load_world(world).track if world else paper_track()  # is refused before anything starts
    if find_spec("matplotlib") is None:
        complain(f"the walk gets no plot: {missing_library('matplotlib')}")
    out.mkdir(parents=True, exist_ok=True)
    before = set(log_files(out, DONE))
    try:
        with redirect_stdout(sys.stderr if json else sys.stdout):  # data goes to standard output, all else not
            print("Starting a simulated robot and the daemon ...", flush=True)
            # short, as the path of a Unix socket must be
            with TemporaryDirectory(prefix="mudskipper-", ignore_cleanup_errors=True) as files:
                report, strides = _perform(LocalRobot(Path(files), out, seed, world), track, depth)
            summary = _conclude(out, report, strides, track)
    except (KeyboardInterrupt, NoDaemonError, CallRefusedError, TimeoutError, RuntimeError) as problem:
        for path in sorted(set(log_files(out, DONE)) - before):
            print(f"\nlog      {path}", file=sys.stderr if json else sys.stdout)
        status = exit_codes.INTERRUPTED if isinstance(problem, KeyboardInterrupt) else exit_codes.UNHEALTHY
        raise CommandError(str(problem) or "stopped", status=status) from None
    return Answer(summary, "", schema="demo")


def _interrupt(*_: object) -> None:
    """End the demo as Ctrl-C does; further signals are ignored, since the robot stops meanwhile."""
    for number in ENDING_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def _perform(robot: LocalRobot, track: Track, depth_cm: float | None) -> tuple[Report, list[Report]]:
    """Walk to the end of the track, end the robot, and return its last status and its strides.

    A KeyboardInterrupt says in which state the robot ended.
    """
    state = "stopped before torque was on"
    try:
        os.nice(5)  # the display gives way to robot and daemon
        with ready_client(robot) as client:
            print("Arming ...", flush=True)
            state = "stopped: torque is off, the log is closed"
            client.arm()
            client.wait_for("hold")
            try:
                return _walk(robot, client, track, depth_cm)
            except RuntimeError as fault:
                missed = client.status()["loop"]["missed_ticks"]
                busy = f"The loop missed {missed} ticks: if that is more than a few, this computer was too busy"
                raise RuntimeError(f"{fault} {busy}; close other programs and try again.") from None
    except KeyboardInterrupt:
        robot.end()
        if (status := robot.daemon.returncode) not in (0, -signal.SIGTERM):  # the latter before it handles signals
            state = f"stopped, but the daemon ended with status {status}"
        raise KeyboardInterrupt(state) from None
    finally:
        robot.end()


def _walk(robot: LocalRobot, client: Client, track: Track, depth_cm: float | None) -> tuple[Report, list[Report]]:
    """Walk for LONGEST_WALK_S at most, and switch the torque off."""
    muds = ", ".join(mud_text(segment.ground.name) for segment in track.segments)
    water = " water" if muds.endswith("%") else ""
    print(f"Walking {track.length_m:.2f} m over mud with {muds}{water}.\n")
    print(f"{STRIDE_HEAD}\n{STRIDE_UNITS}", flush=True)
    strides: list[Report] = []
    with robot.connect() as daemon:
        daemon.call("reset_timing")
    client.walk(depth_m=None if depth_cm is None else depth_cm / 100.0)
    start_s = time.monotonic()

    def fetch_strides() -> None:
        while fetched := client.strides(len(strides)):
            strides.extend(fetched)
            for stride in fetched:
                print(stride_line(stride, start_s), flush=True)

    position_m = 0.0
    while position_m < track.length_m - FINISH_M and time.monotonic() < start_s + LONGEST_WALK_S:
        robot.check_processes()
        position_m = client.wait_for("walking")["body_x_m"] or 0.0
        fetch_strides()
        time.sleep(POLL_S)
    client.stop()
    report = client.wait_for("hold")
    client.disarm()
    fetch_strides()
    return report, strides


def _conclude(out: Path, report: Report, strides: list[Report], track: Track) -> Report:
    """Print the summary, draw the plot, and return the summary."""
    log_path = present_path(Path(report["log"]["path"]))
    plot_path = out / log_path.with_suffix(".png").name if find_spec("matplotlib") else None
    summary = summarise(report, strides, track, log_path, plot_path)
    print(f"\n{summary_text(summary, report)}", flush=True)
    if plot_path is None:
        return summary
    print("Drawing ...", flush=True)
    from experiments.pictures.mud_layout import layout_of_track
    from experiments.pictures.recorded_walk import read_walk
    from experiments.pictures.walk_plot import plot_walk  # matplotlib loads slowly; the walk must not wait

    plot_walk(read_walk(log_path), plot_path, layout_of_track(track))
    print(f"plot     {plot_path}")
    return summary


def summarise(report: Report, strides: list[Report], track: Track, log_path: Path, plot_path: Path | None) -> Report:
    rows = read_log(log_path, fields=("mode", "stamp_s", "body_x_m")).ticks
    walked = rows[(rows["mode"] == Mode.WALKING) & np.isfinite(rows["body_x_m"])]
    stamps_s, positions_m = walked["stamp_s"], walked["body_x_m"]

    def mud_of(stride: Report) -> str:
        start_m = float(np.interp(stride["t_start_s"], stamps_s, positions_m)) if len(walked) else 0.0
        return track.ground_at(start_m + LEAD_M).name

    return {
        **report["loop"],
        "strides": [stride | {"mud": mud_of(stride)} for stride in strides],
        "speed_cm_s": speeds_cm_s(stamps_s, positions_m, track),
        "dropped_rows": report["log"]["dropped"],
        "warnings": report["warnings"],
        "log": str(log_path),
        "plot": str(plot_path) if plot_path else None,
    }


def speeds_cm_s(
    stamps_s: np.ndarray[Any, Any], positions_m: np.ndarray[Any, Any], track: Track
) -> dict[str, float | None]:
    """Return the mean speed from the first arrival in each mud to the first arrival in the next."""
    speeds: dict[str, float | None] = {}
    start_m = float(positions_m[0]) if len(positions_m) else 0.0
    reached_m = np.maximum.accumulate(positions_m)
    for segment in track.segments:
        first, last = (int(row) for row in np.searchsorted(reached_m, (start_m, segment.end_m)))
        last = min(last, len(reached_m) - 1)
        name = segment.ground.name
        if name in speeds:  # the same mud again
            name = f"{name} at {start_m:.2f} m"
        speeds[name] = None
        if first < last:
            distance_m, duration_s = positions_m[last] - positions_m[first], stamps_s[last] - stamps_s[first]
            speeds[name] = round(100.0 * float(distance_m / duration_s), 2)
        start_m = segment.end_m
    return speeds


def summary_text(summary: Report, report: Report) -> str:
    speeds = ", ".join(
        f"{mud_text(mud)}: {'-' if speed is None else f'{speed:.1f} cm/s'}"
        for mud, speed in summary["speed_cm_s"].items()
    )
    lines = [
        ("strides", f"{len(summary['strides'])} of both flippers"),
        ("speed", speeds),
        *((name, text) for name, (text, _) in machine_lines(report) if name in ("loop", "late", "tick")),
        *([("lost", f"{counted(summary['dropped_rows'], 'row')} of the log")] if summary["dropped_rows"] else []),
        *(("warning", warning) for warning in summary["warnings"]),
        ("log", summary["log"]),
    ]
    return "\n".join(f"{name:8} {text}" for name, text in lines)
