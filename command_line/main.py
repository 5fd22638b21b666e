"""Parses the command line of `mudskipper` and runs the command.

The module of a command is imported only when the command is used, so `status` starts fast.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

from command_line import exit_codes
from command_line.commands import DEFAULT_CONFIG, SIMULATED, Commands, add, add_json, add_socket, add_vertical
from command_line.experiments.experiment_commands import add_experiments
from command_line.option_types import any_depth_cm, between, depth_cm, finite, folder, joint_angle, picture, whole
from command_line.screen import complain
from firmware_host.configuration.file_problems import why_not

METHODS = ("default", "paper")  # of estimation
EXTRA_OF = {"matplotlib": "plots", "PIL": "plots", "pyarrow": "data", "duckdb": "data", "pandas": "data"}  # by module
VIEWERS = ("foxglove", "plotjuggler", "rerun")
COUNT = whole(0, 100000)
SEVERAL_FILES = "log of this project; several files are the segments of one run"
ANY_LOG = "log of this project, its segments, or a CSV file of the paper's authors"


class Parser(argparse.ArgumentParser):
    """Refuses abbreviated options, also of its commands: `arm --f` would overrule failed checks."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords | {"allow_abbrev": False})


class PrintVersion(argparse.Action):
    """Prints the installed version and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from firmware_host.software_version import software_version  # slow to import, and seldom wanted

        print(f"mudskipper {software_version()}")
        parser.exit()


class PrintCompletion(argparse.Action):
    """Prints a completion script for a shell and ends."""

    def __call__(self, parser: argparse.ArgumentParser, _: object, shell: object, __: object = None) -> NoReturn:
        import shtab

        print(shtab.complete(parser, str(shell)))
        parser.exit()


def build_parser() -> argparse.ArgumentParser:
    statuses = ", ".join(f"{status} {meaning}" for status, meaning in exit_codes.MEANINGS.items())
    parser: argparse.ArgumentParser = Parser(
        prog="mudskipper",
        description="Operates a robot that crawls over mud on two flippers.",
        epilog=f"Exit status: {statuses}.",
    )
    parser.add_argument("--version", action=PrintVersion, nargs=0, help="print the version and exit")
    parser.add_argument(
        "--print-completion",
        action=PrintCompletion,
        choices=("bash", "zsh", "tcsh"),
        help="print a completion script for this shell and exit",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="command")
    _add_operation(commands)
    _add_fail(commands)
    _add_live(commands)
    _add_installation(commands)
    _add_simulation(commands)
    _add_replay(commands)
    _add_pictures(commands)
    _add_logs(commands)
    add_experiments(commands)
    return parser


def _add_operation(commands: Commands) -> None:
    described = {
        "status": "Print the state of the robot.",
        "arm": "Switch torque on. The robot holds its present pose.",
        "walk": "Walk, with a fixed depth or one that adapts to the mud.",
        "move": "Move joints slowly to other angles while the robot holds its pose.",
        "stop": "End the walk, raise the flippers and hold the pose.",
        "disarm": "Switch torque off at once, in any state.",
        "clear": "Clear a fault and the errors of the drives.",
        "check": "List what prevents the robot from being armed, and what to do about it.",
    }
    modules = dict.fromkeys(("stop", "disarm"), "confirmed_stop")
    parsers = {
        name: add(commands, name, f"operation.{modules.get(name, 'operation')}.{name}", text)
        for name, text in described.items()
    }
    parsers["watch"] = add(commands, "watch", "watch.watch.watch", "Show the robot live, with keys that operate it.")
    parsers["watch"].add_argument("--lines", action="store_true", help="plain lines, as in a pipe, also on a terminal")
    parsers["watch"].add_argument(
        "--period", type=between(0.05, 3600.0, "s"), metavar="S", help="seconds between two (default: 0.1; lines: 1)"
    )
    for parser in parsers.values():
        add_socket(parser)
    add_json(parsers["status"], parsers["check"])
    parsers["arm"].add_argument("--force", action="store_true", help="overrule failed checks that are not mandatory")
    parsers["move"].add_argument("angles", type=joint_angle, nargs="+", metavar="JOINT=DEG", help="left_sweep=10 ...")
    parsers["check"].add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG), help="used without a daemon")
    _add_walk_options(parsers["walk"])
    for name in ("arm", "walk", "move"):
        parsers[name].add_argument(
            "--take-over", action="store_true", help="take the lease from a program that holds it"
        )


def _add_walk_options(walk: argparse.ArgumentParser) -> None:
    depth = walk.add_mutually_exclusive_group()
    depth.add_argument("--depth", type=any_depth_cm, metavar="CM", help="insertion depth of every stride")
    depth.add_argument("--adaptive", action="store_true", help="choose the depth from the mud once a stride (default)")
    walk.add_argument("--strides", type=whole(1, 100000), default=0, metavar="N", help="stop after N (default: go on)")
    walk.add_argument("--attended", action="store_true", help="stay connected; the robot stops when this command ends")


def _add_fail(commands: Commands) -> None:
    fail = add(commands, "fail", "operation.failing.fail", "Make a part of the robot fail on purpose, where allowed.")
    add_socket(fail)
    add_json(fail)
    fail.add_argument("component", nargs="?", help="left_sweep, bus.left, pose ..., or all")
    fail.add_argument("kind", nargs="?", help="off, stuck, garbage, slow, intermittent ..., or ok to end the failure")
    fail.add_argument("--for", type=finite, default=2.0, metavar="S", dest="seconds", help="seconds until it ends")
    fail.add_argument("--list", action="store_true", help="list what can fail, how, and what fails now")


def _add_live(commands: Commands) -> None:
    live = add(commands, "live", "live.live.live", "Pass the robot's rows on to Foxglove, Lichtblick or a browser.")
    add_socket(live)
    live.add_argument("--page", action="store_true", help="serve a page for a browser in place of a viewer's WebSocket")
    live.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="to listen on (default: %(default)s)")
    live.add_argument("--port", type=whole(0, 65535), default=8765, metavar="N", help="0: a free one (default: 8765)")


def _add_installation(commands: Commands) -> None:
    doctor = add(commands, "doctor", "doctor.doctor.doctor", "Check this computer and its buses, line by line.")
    doctor.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG))
    add_json(doctor)
    socket = os.environ.get("MUDSKIPPER_SOCKET")
    doctor.add_argument("--socket", type=Path, default=Path(socket) if socket else None, help="socket of the daemon")
    install = add(
        commands, "install", "install.installation.install", "Set up the service, network and users of this computer."
    )
    uninstall = add(
        commands, "uninstall", "install.installation.uninstall", "Undo the installation; configuration and logs stay."
    )
    uninstall.add_argument("--purge", action="store_true", help="remove configuration, logs and user too")
    for parser in (install, uninstall):
        parser.add_argument("--dry-run", action="store_true", help="only show what would be done")
        parser.add_argument("--root", type=Path, default=Path("/"), metavar="DIR", help="root folder of another system")


def _add_simulation(commands: Commands) -> None:
    demo = add(commands, "demo", "demo.demo.demo", "Walk a simulated robot over three muds, in real time.")
    demo.add_argument("--json", type=Path, metavar="PATH", help="also write the summary to this file")
    demo.add_argument("--out", type=folder, default=Path("mudskipper-demo"), metavar="DIR", help="for log and plot")
    demo.add_argument("--seed", type=int, default=1)
    demo.add_argument("--depth", type=depth_cm, metavar="CM", help="fixed insertion depth (default: adaptive)")
    demo.add_argument("--world", type=Path, metavar="FILE", help="describes the ground (default: three muds)")
    simulate = add(commands, "simulate", "simulate.simulate", "Simulate the robot on a bus until Ctrl-C.")
    simulate.add_argument("--bus", default=SIMULATED, metavar="NAME", help="of the local bus")
    simulate.add_argument("--config", type=Path, help="use the buses of this configuration")
    ground = simulate.add_mutually_exclusive_group()
    ground.add_argument("--mud", action="append", metavar="W", help="water content, repeatable: 48.5, 53.1, 45.3")
    ground.add_argument("--world", type=Path, metavar="FILE", help="describes the ground and more")
    ground.add_argument("--on-blocks", action="store_true", help="no mud: the flippers move in air, for the bench")
    simulate.add_argument("--seed", type=int, default=1)


def _add_replay(commands: Commands) -> None:
    replay = add(commands, "replay", "logs.log_commands.replay", "Run the estimator over a recorded log.")
    replay.add_argument("files", type=Path, nargs="+", metavar="FILE", help=ANY_LOG)
    add_json(replay)
    replay.add_argument("--config", type=Path, help="use this configuration (default: the one in the log)")
    replay.add_argument("--method", choices=METHODS, help="estimate by this method (default: the configured one)")
    add_vertical(replay)


def _add_pictures(commands: Commands) -> None:
    plot = add(commands, "plot", "logs.log_commands.plot", "Draw a walk against time: forces, coefficients, depth.")
    film = add(commands, "film", "logs.log_commands.film", "Draw strides from the side, as a strip or a film.")
    plot.add_argument("--out", type=picture(".png", ".svg", ".pdf"), metavar="PNG", help="or .svg, .pdf")
    film.add_argument("--out", type=picture(".png", ".gif"), metavar="FILE", help=".png for a strip, .gif for a film")
    film.add_argument("--stride", action="append", type=COUNT, metavar="N", help="number in the replay, repeatable")
    for parser in (plot, film):
        parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help=ANY_LOG)
        parser.add_argument("--walk", type=COUNT, default=0, metavar="N", help="number of the walk (default: the last)")
        add_vertical(parser)


def _add_logs(commands: Commands) -> None:
    log = commands.add_parser("log", help="Read and manage logs.")
    actions = log.add_subparsers(dest="action", required=True, metavar="action")
    info = add(actions, "info", "logs.log_commands.info", "Print what a log contains.")
    info.add_argument("files", type=Path, nargs="+", metavar="FILE", help=SEVERAL_FILES)
    report = add(actions, "report", "logs.log_report.log_report", "Write a log as one page with pictures.")
    report.add_argument("files", type=Path, nargs="+", metavar="FILE", help=ANY_LOG)
    report.add_argument("--out", type=folder, metavar="DIR", help="(default: a folder named after the log)")
    _add_export(actions)
    preserve = add(actions, "preserve", "logs.log_folder_commands.preserve_log", "Exclude logs from the quota.")
    preserve.add_argument("files", type=Path, nargs="+", metavar="FILE")
    preserve.add_argument("--undo", action="store_true", help="include them again")
    _add_catalogue(actions)
    opening = add(actions, "open", "viewers.open_log.open_log", "Open a log in a viewer, with the project's layout.")
    opening.add_argument("file", type=Path)
    opening.add_argument(
        "--with", choices=VIEWERS, required=True, dest="viewer", help="foxglove: Lichtblick or Foxglove"
    )
    listing = add(actions, "list", "logs.log_folder_commands.list_logs", "List the logs and the room that is left.")
    listing.add_argument("folder", type=Path, nargs="?", help="of the logs (default: the configured one)")
    recover = add(actions, "recover", "logs.log_folder_commands.recover", "Repair logs whose writer was interrupted.")
    recover.add_argument("places", type=Path, nargs="*", metavar="FILE|DIR", help="(default: the configured folder)")
    for parser in (listing, recover):
        parser.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG), help="names the folder")
    add_vertical(info)
    add_vertical(report)
    add_json(info, report, listing, recover)


def _add_catalogue(actions: Commands) -> None:
    index = add(actions, "index", "logs.catalogue_commands.index", "Read all new logs of a folder into its catalogue.")
    query = add(actions, "query", "logs.catalogue_commands.query", "Answer a SELECT on the catalogue of the logs.")
    query.add_argument("sql", metavar="SQL", help='such as "select file, strides, speed_m_s from logs"')
    for parser in (index, query):
        parser.add_argument("folder", type=Path, nargs="?", metavar="DIR", help="of the logs (default: the configured)")
        parser.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG), help="names the folder")
    add_json(index, query)


def _add_export(actions: Commands) -> None:
    export = add(actions, "export", "logs.log_export.export", "Write a log in a form that other programs read.")
    export.add_argument("files", type=Path, nargs="+", metavar="FILE", help=SEVERAL_FILES)
    form = export.add_mutually_exclusive_group(required=True)
    form.add_argument("--csv", action="store_true", help="the columns of the authors' plotter, to standard output")
    form.add_argument("--parquet", action="store_true", help="tables of ticks, strides and events, into this folder")
    form.add_argument("--ros", action="store_true", help="the log with standard ROS 2 messages, to LOG-ros.mcap here")
    export.add_argument("--out", type=Path, metavar="PATH", help="write this file, for --parquet into this folder")


def main(arguments: Sequence[str] | None = None) -> int:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without ± or ³ shows a question mark
    try:
        options = build_parser().parse_args(arguments)
        module, function = options.function.rsplit(".", 1)
        run: Callable[[argparse.Namespace], int] = getattr(import_module(f"command_line.{module}"), function)
        return run(options)
    except KeyboardInterrupt:
        return exit_codes.INTERRUPTED
    except ModuleNotFoundError as problem:
        module = (problem.name or "").partition(".")[0]
        if module not in EXTRA_OF:
            raise
        complain(f"{module} is not installed, which this needs: install mudskipper with its extra '{EXTRA_OF[module]}'")
        return exit_codes.UNHEALTHY
    except BrokenPipeError:  # the reader of the output, such as `head`, has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return exit_codes.OK
    except OSError as problem:
        complain(why_not(problem))
        return exit_codes.UNHEALTHY


if __name__ == "__main__":
    sys.exit(main())
