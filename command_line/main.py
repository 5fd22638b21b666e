"""`mudskipper`, the command that people type. Each sub-command is loaded only when it is used, so `status` starts at
once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path

from command_line import exit_codes
from command_line.commands import DEFAULT_CONFIG, Commands, add, add_socket
from command_line.experiments.experiment_commands import add_experiments
from command_line.option_types import between, depth_cm, finite, folder, joint_angle, picture, whole
from command_line.screen import complain
from firmware_host.configuration.file_problems import why_not

METHODS = ("default", "paper")  # of estimation
PICTURE_MODULES = ("matplotlib", "PIL")  # an extra of this package
COUNT = whole(0, 100000)  # of strides, or one of them


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="mudskipper",
        description="Operates a robot that crawls over mud on two flippers.",
        epilog="Exit status: 0 done, 1 unhealthy, 2 usage, 3 no daemon, 4 not permitted, 5 refused, 78 configuration,"
        " 124 timed out, 130 interrupted.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="command")
    _add_operation(commands)
    _add_simulation(commands)
    _add_logs(commands)
    add_experiments(commands)
    return parser


def _add_operation(commands: Commands) -> None:
    described = {
        "status": "How the robot is.",
        "watch": "The status, again and again, until Ctrl-C.",
        "arm": "Switch torque on; the robot holds its pose.",
        "walk": "Walk, with the depth adapted to the mud or fixed.",
        "move": "Take joints slowly to other angles, while the robot holds its pose.",
        "stop": "End a walk: raise the flippers and hold.",
        "disarm": "Switch torque off, at once, in any state.",
        "clear": "Clear a fault and the drives' errors.",
        "check": "What stands between this robot and a walk.",
    }
    parsers = {name: add(commands, name, f"operation.operation.{name}", text) for name, text in described.items()}
    parsers["fail"] = _add_fail(commands)
    for parser in parsers.values():
        add_socket(parser)
    for name in ("status", "check", "fail"):
        parsers[name].add_argument("--json", action="store_true", help="for machines")
    parsers["watch"].add_argument(
        "--period", type=between(0.05, 3600.0), default=0.5, metavar="S", help="between two looks"
    )
    parsers["arm"].add_argument("--force", action="store_true", help="against what 'check' does not call mandatory")
    depth = parsers["walk"].add_mutually_exclusive_group()
    depth.add_argument("--depth", type=depth_cm, metavar="CM", help="the same in every stride")
    depth.add_argument("--adaptive", action="store_true", help="chosen from the mud, once a stride (default)")
    parsers["walk"].add_argument("--strides", type=COUNT, default=0, metavar="N", help="then stop (default: go on)")
    parsers["walk"].add_argument("--attended", action="store_true", help="stay; the robot stops when this ends")
    parsers["move"].add_argument("angles", type=joint_angle, nargs="+", metavar="JOINT=DEG", help="left_sweep=10 ...")
    for name in ("arm", "walk", "move"):
        text = "from a program that holds the robot's lease, which stays out then"
        parsers[name].add_argument("--take-over", action="store_true", help=text)
    parsers["check"].add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG))
    _add_installation(commands)


def _add_installation(commands: Commands) -> None:
    doctor = add(
        commands, "doctor", "doctor.doctor.doctor", "The computer and its buses, line by line, with what to do."
    )
    doctor.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG))
    doctor.add_argument("--json", action="store_true", help="for machines")
    socket = os.environ.get("MUDSKIPPER_SOCKET")
    doctor.add_argument("--socket", type=Path, default=Path(socket) if socket else None, help="of the daemon")
    install = add(
        commands, "install", "install.installation.install", "Set up this computer's service, network and users."
    )
    uninstall = add(
        commands, "uninstall", "install.installation.uninstall", "Take that back; configuration and logs stay."
    )
    uninstall.add_argument("--purge", action="store_true", help="remove configuration, logs and user too")
    for parser in (install, uninstall):
        parser.add_argument("--dry-run", action="store_true", help="only show what would be done")
        parser.add_argument("--root", type=Path, default=Path("/"), metavar="DIR", help="of another system's files")


def _add_fail(commands: Commands) -> argparse.ArgumentParser:
    fail = add(
        commands, "fail", "operation.failing.fail", "Make a part of the robot fail on purpose, where that is allowed."
    )
    fail.add_argument("component", nargs="?", help="what fails, such as left_sweep, bus.left, pose; or all")
    fail.add_argument("kind", nargs="?", help="off, stuck, garbage, slow, intermittent ..., or ok to end it")
    fail.add_argument("--for", type=finite, default=2.0, metavar="S", dest="seconds", help="then it ends by itself")
    fail.add_argument(
        "--list", action="store_true", help="what can fail, how, and what fails already; with --json also what it does"
    )
    return fail


def _add_simulation(commands: Commands) -> None:
    demo = add(commands, "demo", "demo.demo.demo", "A simulated robot walks over three muds, in real time.")
    demo.add_argument("--json", type=Path, metavar="PATH", help="write the summary there too")
    demo.add_argument("--out", type=folder, default=Path("mudskipper-demo"), metavar="DIR", help="for log and plot")
    demo.add_argument("--seed", type=int, default=1)
    demo.add_argument("--depth", type=depth_cm, metavar="CM", help="fixed instead of adaptive")
    demo.add_argument("--world", type=Path, metavar="FILE", help="describes the ground, instead of three muds")
    simulate = add(commands, "simulate", "simulate.simulate", "The simulated robot alone, on a bus, until Ctrl-C.")
    simulate.add_argument("--bus", default="robot", metavar="NAME", help="of the local bus (default: %(default)s)")
    simulate.add_argument("--config", type=Path, help="on the buses of this configuration instead")
    ground = simulate.add_mutually_exclusive_group()
    ground.add_argument("--mud", action="append", metavar="W", help="water content, repeatable: 48.5, 53.1, 45.3")
    ground.add_argument("--world", type=Path, metavar="FILE", help="describes the ground, and more")
    ground.add_argument("--on-blocks", action="store_true", help="for the bench: without mud, the flippers in air")
    simulate.add_argument("--seed", type=int, default=1)


def _add_logs(commands: Commands) -> None:
    replay = add(
        commands, "replay", "logs.log_commands.replay", "The estimator over a recorded log: ours, or the authors' CSV."
    )
    replay.add_argument("files", type=Path, nargs="+", metavar="FILE", help="several are segments of one run")
    replay.add_argument("--json", action="store_true")
    replay.add_argument("--config", type=Path, help="instead of the one in the log")
    replay.add_argument("--method", choices=METHODS, help="of estimation, instead of the configured one")
    _add_pictures(commands)
    log = commands.add_parser("log", help="Look into logs, and look after them.")
    actions = log.add_subparsers(dest="action", required=True, metavar="action")
    _add_log_folder(actions)
    _add_log_contents(actions)


def _add_pictures(commands: Commands) -> None:
    plot = add(
        commands, "plot", "logs.log_commands.plot", "A walk against time: forces, coefficients, depth, place and steps."
    )
    film = add(
        commands, "film", "logs.log_commands.film", "Strides seen from the side: as a strip of pictures, or moving."
    )
    plot.add_argument("--out", type=picture(".png", ".svg", ".pdf"), metavar="PNG", help="or .svg, .pdf")
    film.add_argument("--out", type=picture(".png", ".gif"), metavar="FILE", help=".png for a strip, .gif for a film")
    film.add_argument("--stride", action="append", type=COUNT, metavar="N", help="as replay counts them, repeatable")
    for parser in (plot, film):
        parser.add_argument(
            "files",
            type=Path,
            nargs="+",
            metavar="FILE",
            help="our log, segments of one run, or the authors' CSV",
        )
        parser.add_argument("--walk", type=COUNT, default=0, metavar="N", help="of the log's walks (default: the last)")


def _add_log_contents(actions: Commands) -> None:
    info = add(actions, "info", "logs.log_commands.info", "What a log holds.")
    info.add_argument("files", type=Path, nargs="+", metavar="FILE", help="several are segments of one run")
    info.add_argument("--json", action="store_true")
    report = add(actions, "report", "logs.log_report.log_report", "What a log tells, as one page with its pictures.")
    report.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="our log, its segments, or the authors' CSV"
    )
    report.add_argument("--out", type=folder, metavar="DIR", help="(default: a folder named after the log)")
    report.add_argument("--json", action="store_true", help="its numbers on standard output")
    export = add(actions, "export", "logs.log_commands.export", "A log in the columns of the authors' plotter.")
    export.add_argument("file", type=Path)
    export.add_argument("--csv", action="store_true", required=True, help="the format; there is one so far")
    export.add_argument("--out", type=Path, help="file to write (default: standard output)")


def _add_log_folder(actions: Commands) -> None:
    listing = add(actions, "list", "logs.log_folder_commands.list_logs", "The logs, and what room is left.")
    listing.add_argument("folder", type=Path, nargs="?", help="of the logs (default: the configured one)")
    recover = add(
        actions, "recover", "logs.log_folder_commands.recover", "Logs whose writer was cut off, put in order."
    )
    recover.add_argument("places", type=Path, nargs="*", metavar="FILE|DIR", help="(default: the configured folder)")
    for parser in (listing, recover):
        parser.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG), help="names the folder")
        parser.add_argument("--json", action="store_true", help="for machines")
    preserve = add(
        actions, "preserve", "logs.log_folder_commands.preserve_log", "Keep a log when older ones are freed."
    )
    preserve.add_argument("files", type=Path, nargs="+", metavar="FILE")
    preserve.add_argument("--undo", action="store_true", help="let it be freed again")


def main(arguments: Sequence[str] | None = None) -> int:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no ± or ³ shows a question mark
    try:
        options = build_parser().parse_args(arguments)
        module, function = options.place.rsplit(".", 1)
        run: Callable[[argparse.Namespace], int] = getattr(import_module(f"command_line.{module}"), function)
        return run(options)
    except KeyboardInterrupt:
        return exit_codes.INTERRUPTED
    except ModuleNotFoundError as problem:
        if problem.name not in PICTURE_MODULES:
            raise
        complain("pictures need matplotlib: install mudskipper with its extra 'plots'")
        return exit_codes.UNHEALTHY
    except BrokenPipeError:  # the reader of our output, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return exit_codes.OK
    except OSError as problem:
        complain(why_not(problem))
        return exit_codes.UNHEALTHY


if __name__ == "__main__":
    sys.exit(main())
