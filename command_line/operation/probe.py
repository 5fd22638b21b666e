"""Finds the height of the mud with the flippers of a robot that holds its pose: `mudskipper probe`."""

from math import degrees
from pathlib import Path
from sys import stderr
from typing import Annotated, Any

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.json_output import Answer
from command_line.screen import Progress, complain
from command_line.shared_options import Socket
from experiments.actuator.configuration_change import require_changeable
from experiments.actuator.file_change import Changes, FileChangeError, change_file
from experiments.reports.text_tables import table
from experiments.robot.daemon_robot import DaemonRobot
from experiments.robot.surface_probe import ProbedSurface, probe_surface
from experiments.study.option import Option


def probe(
    *,
    socket: Socket,
    config: Annotated[Path | None, Option("of the daemon, to write the height and its error to")] = None,
) -> Answer:
    """Touch the mud lightly at five sweeps of each flipper, and write what was found into the log."""
    robot, progress = DaemonRobot(Path(socket)), Progress("touches")
    leave = robot.leave_holding
    try:
        text = robot.configuration.text
        if (mode := robot.call("status")["mode"]) != "hold":
            message = f"the robot is in {mode} and does not hold its pose: 'mudskipper arm' first"
            raise CommandError(message, status=exit_codes.REFUSED)
        if config:
            require_changeable(config, text)
        leave = robot.close
        found = probe_surface(robot, progress.show)
        robot.call("note", text=f"probe: {surface_text(found)}")
        leave = robot.leave_holding
    finally:
        progress.clear()
        leave()
    axis_height_m = robot.configuration.geometry.axis_height_m + found.depth_m
    changes: Changes = {
        ("geometry", "axis_height_m"): round(axis_height_m, 5),
        ("estimation", "surface_error_m"): round(found.stride_error_m, 5),
    }
    status = exit_codes.OK
    try:
        if config:
            done = change_file(config, text, changes, show_difference)
            print(f"{done}. 'systemctl restart mudskipper' uses it", file=stderr)
    except FileChangeError as problem:  # such as a greatest depth that is out of reach then
        complain(str(problem))
        status = exit_codes.REFUSED
    return Answer(probe_report(found, changes), probe_text(found, changes), status, schema="probe")


def surface_text(found: ProbedSurface) -> str:
    side = "below" if found.depth_m > 0.0 else "above"
    return (
        f"the surface is {1000.0 * abs(found.depth_m):.1f} ± {1000.0 * found.std_error_m:.1f} mm {side} its nominal"
        f" height, and differs by {1000.0 * found.scatter_m:.1f} mm between {len(found.touches)} touches"
    )


def probe_text(found: ProbedSurface, changes: Changes) -> str:
    rows = [["flipper", "sweep", "below nominal", "std. error"]]
    for flipper, sweep_rad, surface in found.touches:
        cells = (f"{1000.0 * each:z.2f} mm" for each in (surface.depth_m, surface.std_error_m))
        rows.append([flipper, f"{degrees(sweep_rad):z.0f}°", *cells])
    keys = "\n".join(f"{'.'.join(key)} = {value}" for key, value in changes.items())
    return f"{table(rows)}\n\n{surface_text(found)}. In the configuration this is\n{keys}"


def probe_report(found: ProbedSurface, changes: Changes) -> dict[str, Any]:
    touches = [
        {"flipper": flipper, "sweep_rad": sweep_rad, "depth_m": each.depth_m, "std_error_m": each.std_error_m}
        for flipper, sweep_rad, each in found.touches
    ]
    summary = {"depth_m": found.depth_m, "std_error_m": found.std_error_m, "scatter_m": found.scatter_m}
    return summary | {key: value for (*_, key), value in changes.items()} | {"touches": touches}


def show_difference(difference: str) -> bool:
    """Return True: a user who names a file has agreed to its change."""
    print(difference, file=stderr)
    return True
