"""`mudskipper`, the command that people type. Each sub-command is loaded only when it is used, so `status` starts at
once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from io import TextIOWrapper
from math import isfinite
from pathlib import Path

from command_line import exit_codes
from command_line.screen import complain
from control.records import JOINTS

DEFAULT_SOCKET = "/run/mudskipper/mudskipper.sock"
METHODS = ("default", "paper")  # of estimation
PICTURE_MODULES = ("matplotlib", "PIL")  # an extra of this package
DEFAULT_CONFIG = "/etc/mudskipper/mudskipper.toml"


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
    _add_experiments(commands)
    return parser


Commands = "argparse._SubParsersAction[argparse.ArgumentParser]"


def _add(commands: Commands, name: str, place: str, text: str) -> argparse.ArgumentParser:  # type: ignore[valid-type]
    """`place` is `module.function` of this package, imported when the command is used."""
    command: argparse.ArgumentParser = commands.add_parser(name, help=text, description=text)  # type: ignore[attr-defined]
    command.set_defaults(place=place)
    return command


def _add_operation(commands: Commands) -> None:  # type: ignore[valid-type]
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
    parsers = {name: _add(commands, name, f"operation.{name}", text) for name, text in described.items()}
    parsers["fail"] = _add_fail(commands)
    for parser in parsers.values():
        _add_socket(parser)
    for name in ("status", "check", "fail"):
        parsers[name].add_argument("--json", action="store_true", help="for machines")
    parsers["watch"].add_argument("--period", type=_seconds, default=0.5, metavar="S", help="between two looks")
    parsers["arm"].add_argument("--force", action="store_true", help="against what 'check' does not call mandatory")
    depth = parsers["walk"].add_mutually_exclusive_group()
    depth.add_argument("--depth", type=_depth_cm, metavar="CM", help="the same in every stride")
    depth.add_argument("--adaptive", action="store_true", help="chosen from the mud, once a stride (default)")
    parsers["walk"].add_argument("--strides", type=_count, default=0, metavar="N", help="then stop (default: go on)")
    parsers["walk"].add_argument("--attended", action="store_true", help="stay; the robot stops when this ends")
    parsers["move"].add_argument("angles", type=_joint_angle, nargs="+", metavar="JOINT=DEG", help="left_sweep=10 ...")
    parsers["check"].add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG))
    _add_installation(commands)


def _add_installation(commands: Commands) -> None:  # type: ignore[valid-type]
    doctor = _add(commands, "doctor", "doctor.doctor", "The computer and its buses, line by line, with what to do.")
    doctor.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG))
    doctor.add_argument("--json", action="store_true", help="for machines")
    socket = os.environ.get("MUDSKIPPER_SOCKET")
    doctor.add_argument("--socket", type=Path, default=Path(socket) if socket else None, help="of the daemon")
    install = _add(commands, "install", "installation.install", "Set up this computer's service, network and users.")
    uninstall = _add(commands, "uninstall", "installation.uninstall", "Take that back; configuration and logs stay.")
    uninstall.add_argument("--purge", action="store_true", help="remove configuration, logs and user too")
    for parser in (install, uninstall):
        parser.add_argument("--dry-run", action="store_true", help="only show what would be done")
        parser.add_argument("--root", type=Path, default=Path("/"), metavar="DIR", help="of another system's files")


def _add_fail(commands: Commands) -> argparse.ArgumentParser:  # type: ignore[valid-type]
    fail = _add(commands, "fail", "failing.fail", "Make a part of the robot fail on purpose, where that is allowed.")
    fail.add_argument("component", nargs="?", help="what fails, such as left_sweep, bus.left, pose; or all")
    fail.add_argument("kind", nargs="?", help="off, stuck, garbage, slow, intermittent ..., or ok to end it")
    fail.add_argument("--for", type=_finite, default=2.0, metavar="S", dest="seconds", help="then it ends by itself")
    fail.add_argument(
        "--list", action="store_true", help="what can fail, how, and what fails already; with --json also what it does"
    )
    return fail


def _finite(text: str) -> float:
    value = float(text)
    if not isfinite(value):
        raise argparse.ArgumentTypeError(f"{text}: must be a number")
    return value


def _joint_angle(text: str) -> tuple[str, float]:
    joint, _, angle_deg = text.partition("=")
    with suppress(ValueError):
        if joint and isfinite(float(angle_deg)):
            return joint, float(angle_deg)
    raise argparse.ArgumentTypeError(f"{text}: must be a joint and its angle in degrees, as left_sweep=10") from None


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.05 <= value <= 3600.0:
        raise argparse.ArgumentTypeError(f"{text}: must be from 0.05 to 3600")
    return value


def _count(text: str) -> int:
    value = int(text)
    if not 0 <= value <= 100000:
        raise argparse.ArgumentTypeError(f"{text}: must be from 0 to 100000")
    return value


def _depth_cm(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 20.0:
        raise argparse.ArgumentTypeError(f"{text}: must be more than 0 and at most 20")
    return value


def _add_simulation(commands: Commands) -> None:  # type: ignore[valid-type]
    demo = _add(commands, "demo", "demo.demo", "A simulated robot walks over three muds, in real time.")
    demo.add_argument("--json", type=Path, metavar="PATH", help="write the summary there too")
    demo.add_argument("--out", type=Path, default=Path("mudskipper-demo"), metavar="DIR", help="for log and plot")
    demo.add_argument("--seed", type=int, default=1)
    demo.add_argument("--depth", type=_depth_cm, metavar="CM", help="fixed instead of adaptive")
    demo.add_argument("--world", type=Path, metavar="FILE", help="describes the ground, instead of three muds")
    simulate = _add(commands, "simulate", "simulate.simulate", "The simulated robot alone, on a bus, until Ctrl-C.")
    simulate.add_argument("--bus", default="robot", metavar="NAME", help="of the local bus (default: %(default)s)")
    simulate.add_argument("--config", type=Path, help="on the buses of this configuration instead")
    ground = simulate.add_mutually_exclusive_group()
    ground.add_argument("--mud", action="append", metavar="W", help="water content, repeatable: 48.5, 53.1, 45.3")
    ground.add_argument("--world", type=Path, metavar="FILE", help="describes the ground, and more")
    simulate.add_argument("--seed", type=int, default=1)


def _add_logs(commands: Commands) -> None:  # type: ignore[valid-type]
    replay = _add(commands, "replay", "logs.replay", "The estimator over a recorded log: ours, or the authors' CSV.")
    replay.add_argument("files", type=Path, nargs="+", metavar="FILE", help="several are segments of one run")
    replay.add_argument("--json", action="store_true")
    replay.add_argument("--config", type=Path, help="instead of the one in the log")
    replay.add_argument("--method", choices=METHODS, help="of estimation, instead of the configured one")
    plot = _add(commands, "plot", "logs.plot", "A walk against time: forces, coefficients, depth, place and steps.")
    film = _add(commands, "film", "logs.film", "Strides seen from the side: as a strip of pictures, or moving.")
    plot.add_argument("--out", type=_picture(".png", ".svg", ".pdf"), metavar="PNG", help="or .svg, .pdf")
    film.add_argument("--out", type=_picture(".png", ".gif"), metavar="FILE", help=".png for a strip, .gif for a film")
    film.add_argument("--stride", action="append", type=_count, metavar="N", help="as replay counts them, repeatable")
    for parser in (plot, film):
        parser.add_argument(
            "files",
            type=Path,
            nargs="+",
            metavar="FILE",
            help="our log, segments of one run, or the authors' CSV",
        )
        parser.add_argument(
            "--walk", type=_count, default=0, metavar="N", help="of the log's walks (default: the last)"
        )
    log = commands.add_parser("log", help="Look into logs, and look after them.")  # type: ignore[attr-defined]
    actions = log.add_subparsers(dest="action", required=True, metavar="action")
    _add_log_folder(actions)
    info = _add(actions, "info", "logs.info", "What a log holds.")
    info.add_argument("files", type=Path, nargs="+", metavar="FILE", help="several are segments of one run")
    info.add_argument("--json", action="store_true")
    report = _add(actions, "report", "log_report.log_report", "What a log tells, as one page with its pictures.")
    report.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="our log, its segments, or the authors' CSV"
    )
    report.add_argument("--out", type=Path, metavar="DIR", help="(default: a folder named after the log)")
    report.add_argument("--json", action="store_true", help="its numbers on standard output")
    export = _add(actions, "export", "logs.export", "A log in the columns of the authors' plotter.")
    export.add_argument("file", type=Path)
    export.add_argument("--csv", action="store_true", required=True, help="the format; there is one so far")
    export.add_argument("--out", type=Path, help="file to write (default: standard output)")


def _add_log_folder(actions: Commands) -> None:  # type: ignore[valid-type]
    listing = _add(actions, "list", "log_care.list_logs", "The logs, and what room is left.")
    listing.add_argument("folder", type=Path, nargs="?", help="of the logs (default: the configured one)")
    recover = _add(actions, "recover", "log_care.recover", "Logs whose writer was cut off, put in order.")
    recover.add_argument("places", type=Path, nargs="*", metavar="FILE|DIR", help="(default: the configured folder)")
    for parser in (listing, recover):
        parser.add_argument("--config", type=Path, default=Path(DEFAULT_CONFIG), help="names the folder")
        parser.add_argument("--json", action="store_true", help="for machines")
    preserve = _add(actions, "preserve", "log_care.preserve_log", "Keep a log when older ones are freed.")
    preserve.add_argument("files", type=Path, nargs="+", metavar="FILE")
    preserve.add_argument("--undo", action="store_true", help="let it be freed again")


def _picture(*endings: str) -> Callable[[str], Path]:
    def path(text: str) -> Path:
        if not text.endswith(endings):
            raise argparse.ArgumentTypeError(f"{text}: must end with {' or '.join(endings)}")
        return Path(text)

    return path


def _add_experiments(commands: Commands) -> None:  # type: ignore[valid-type]
    experiment = commands.add_parser("experiment", help="The paper's experiments.")  # type: ignore[attr-defined]
    names = experiment.add_subparsers(dest="name", required=True, metavar="name")
    estimation = _add(names, "estimation", "experiment.estimation", "Estimated coefficients against a load cell.")
    _add_report(estimation, "the load cell is a virtual one", "write JSON and picture there")
    estimation.add_argument("--setup", choices=("single", "walking", "both"), default="both")
    estimation.add_argument("--seeds", type=_seeds, default=10, metavar="N", help="trials of each mud (default: 10)")
    muds = estimation.add_mutually_exclusive_group()
    muds.add_argument("--mud", action="append", type=float, metavar="W", help="water content in percent, repeatable")
    muds.add_argument("--strength", action="append", type=_strength_pa, metavar="PA", help="instead, repeatable")
    estimation.add_argument("--layers", metavar="A,B", help="disturbances, separated by commas, or none (default: all)")
    _add_actuator(names)
    _add_trackway(names)
    _add_sweep(names)
    _add_faults(names)
    _add_flipper(names)
    _add_walk(names)
    _add_loadcell(names)
    fit = _add(names, "mud-fit", "walking.run_mud_fit", "The simulator's muds, fitted to the paper's fixed depths.")
    _add_report(fit, "the muds are the simulator's", "write JSON there")
    fit.add_argument("--seeds", type=_seeds, default=2, metavar="N", help="walks of each point (default: 2)")


def _add_report(experiment: argparse.ArgumentParser, simulated: str, out: str) -> None:
    experiment.add_argument("--simulated", action="store_true", help=simulated)
    experiment.add_argument("--json", action="store_true", help="for machines")
    experiment.add_argument("--out", type=Path, metavar="DIR", help=out)


def _add_actuator(names: Commands) -> None:  # type: ignore[valid-type]
    actuator = _add(names, "actuator", "actuator.run_actuator", "Weights on a joint: torque constants and friction.")
    _add_report(actuator, "a simulated motor holds the weights, and nobody is asked", "for report, pictures and log")
    _add_socket(actuator)
    actuator.add_argument(
        "--joint", action="append", choices=JOINTS, help="repeatable (default: right_adduction, right_sweep)"
    )
    actuator.add_argument(
        "--lever", type=_lever_m, metavar="CM", dest="lever_m", help="axle to weight (default: the flipper's length)"
    )
    actuator.add_argument("--weights", type=_weights_g, metavar="G,G,...", help="in grams (default: the paper's)")
    actuator.add_argument("--trials", type=_trials, default=5, metavar="N", help="passes through them (default: 5)")
    actuator.add_argument("--gravity", type=_gravity_m_s2, metavar="M/S2", help="of this place (default: 9.81)")
    actuator.add_argument(
        "--apply", action="store_true", help="write what was fitted to the configuration, if you agree"
    )
    actuator.add_argument("--config", type=Path, metavar="FILE", help=f"to change (default: {DEFAULT_CONFIG})")
    actuator.add_argument("--seed", type=int, default=1, help="of the simulated motor")


def _lever_m(text: str) -> float:
    value = float(text)
    if not 1.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text}: must be from 1 to 100 cm")
    return value / 100.0


def _weights_g(text: str) -> tuple[float, ...]:
    try:
        values = tuple(sorted({float(part) for part in text.split(",") if part.strip()}))
    except ValueError:
        values = ()
    if len(values) < 2 or not all(1.0 <= value <= 5000.0 for value in values):
        raise argparse.ArgumentTypeError(f"{text}: must be two weights or more, from 1 to 5000 g, such as 100,200,400")
    return values


def _gravity_m_s2(text: str) -> float:
    value = float(text)
    if not 9.7 <= value <= 9.9:
        raise argparse.ArgumentTypeError(f"{text}: must be from 9.7 to 9.9, as anywhere on Earth")
    return value


def _add_trackway(names: Commands) -> None:  # type: ignore[valid-type]
    trackway = _add(names, "trackway", "walking.run_trackway", "Three muds in a row, at fixed and at chosen depths.")
    _add_report(trackway, "robot and muds are simulated; else a daemon's robot walks", "for report, pictures and log")
    _add_socket(trackway)
    trackway.add_argument(
        "--trials", "--seeds", type=_seeds, metavar="N", help="of each gait (default: 3, as the paper)"
    )
    trackway.add_argument(
        "--method", action="append", metavar="NAME", help="of adaptation, repeatable to compare (default: default)"
    )
    trackway.add_argument(
        "--compartment", type=_compartment_m, default=0.61, metavar="M", help="length of each mud (default: 0.61)"
    )
    trackway.add_argument("--mud", action="append", metavar="NAME", help="of a real trackway, one after the other")


def _add_socket(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket",
        type=Path,
        default=Path(os.environ.get("MUDSKIPPER_SOCKET", DEFAULT_SOCKET)),
        help="of the daemon (default: $MUDSKIPPER_SOCKET or %(default)s)",
    )


def _add_sweep(names: Commands) -> None:  # type: ignore[valid-type]
    sweep = _add(names, "sweep", "walking.run_sweep", "Speed against depth in muds of any strength.")
    _add_report(sweep, "robot and muds are simulated", "write JSON and picture there")
    sweep.add_argument("--strength", action="append", type=_strength_pa, metavar="PA", help="repeatable (default: 12)")
    sweep.add_argument("--method", action="append", metavar="NAME", help="of adaptation, repeatable (default: all)")
    sweep.add_argument("--seeds", type=_seeds, default=2, metavar="N", help="walks of each point (default: 2)")


def _add_faults(names: Commands) -> None:  # type: ignore[valid-type]
    faults = _add(names, "faults", "fault_trials.run_faults", "Every fault in every phase, against its bounds.")
    _add_report(faults, "what fails is a simulated robot", "write JSON and picture there")
    faults.add_argument("--seeds", type=_seeds, default=1, metavar="N", help="cells of each pair (default: 1)")
    faults.add_argument("--fault", action="append", metavar="NAME", help="repeatable (default: all)")
    faults.add_argument("--phase", action="append", metavar="NAME", help="repeatable (default: all)")


def _add_flipper(names: Commands) -> None:  # type: ignore[valid-type]
    flipper = _add(names, "flipper", "flipper.run_flipper", "A single flipper on a fixed base: coefficients of muds.")
    _add_bench(flipper)
    flipper.add_argument("--mud", action="append", metavar="NAME", help="as its water in percent, repeatable")
    flipper.add_argument("--trials", type=_trials, default=3, metavar="N", help="of each mud (default: 3)")
    flipper.add_argument("--depth", type=_depth_cm, default=3.0, metavar="CM", help="(default: 3)")
    flipper.add_argument("--strides", type=_trials, default=1, metavar="N", help="of each trial (default: 1)")
    flipper.add_argument("--flipper", choices=("left", "right"), default="right", help="in the mud (default: right)")
    flipper.add_argument("--truth", type=Path, metavar="FILE", help="summary.json of a loadcell experiment")


def _add_bench(experiment: argparse.ArgumentParser) -> None:
    """Options of an experiment that a person makes at a robot, or nobody at a simulated one."""
    _add_report(experiment, "robot and muds are simulated, nothing is asked", "for report, logs and what was measured")
    _add_socket(experiment)


def _add_walk(names: Commands) -> None:  # type: ignore[valid-type]
    walk = _add(names, "walk", "walk_trials.run_walk", "The walking robot over several muds: coefficients on the way.")
    _add_bench(walk)
    walk.add_argument(
        "--mud",
        type=_mud_length,
        action="append",
        metavar="NAME[=CM]",
        help="as its water in percent, and its length (default: 61), one after the other along the way",
    )
    walk.add_argument("--trials", type=_trials, default=3, metavar="N", help="over the muds (default: 3)")
    walk.add_argument("--depth", type=_depth_cm, default=3.0, metavar="CM", help="(default: 3)")
    walk.add_argument(
        "--soft", action="append", metavar="NAME", help="mud in which to walk at 3 and at 5 cm besides, repeatable"
    )
    walk.add_argument("--flipper", choices=("left", "right"), default="right", help="to look at (default: right)")
    walk.add_argument("--truth", type=Path, metavar="FILE", help="summary.json of a loadcell experiment")


def _mud_length(text: str) -> tuple[str, float]:
    name, _, length_cm = text.partition("=")
    try:
        value = _finite(length_cm or "61")
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: must be a mud and its length in cm, as 47.6=61") from None
    if not (name and 20.0 <= value <= 10000.0):
        raise argparse.ArgumentTypeError(f"{text}: a mud needs a name, and a length from 20 to 10000 cm")
    return name, value


def _trials(text: str) -> int:
    value = int(text)
    if not 1 <= value <= 100:
        raise argparse.ArgumentTypeError(f"{text}: must be from 1 to 100")
    return value


def _add_loadcell(names: Commands) -> None:  # type: ignore[valid-type]
    loadcell = _add(names, "loadcell", "loadcell.loadcell", "A mud's coefficients from a load cell on a linear stage.")
    _add_report(loadcell, "stage and load cell are emulated", "for report, pictures and samples; goes on where it was")
    loadcell.add_argument(
        "--port", metavar="PATH", help="of the cell's amplifier: /dev/serial/by-id/... is the same always"
    )
    loadcell.add_argument("--baud", type=_baud, default=115200, metavar="N", help="(default: %(default)s)")
    loadcell.add_argument(
        "--format", default="auto", metavar="NAME", help="of its lines: auto, number, indicator, column2, or a pattern"
    )
    loadcell.add_argument(
        "--unit", default="", metavar="U", help="of its numbers: counts, g, kg, N ... (default: as it says)"
    )
    loadcell.add_argument("--scale", type=_positive, metavar="X", help="newtons per unit, instead of a calibration")
    loadcell.add_argument("--calibration", type=Path, metavar="FILE", help="made earlier, instead of two weights")
    loadcell.add_argument(
        "--mud", action="append", metavar="NAME", help="repeatable; simulated: water content in percent"
    )
    loadcell.add_argument(
        "--trials", type=_seeds, default=5, metavar="N", help="of shear and of insertion (default: 5)"
    )
    loadcell.add_argument("--depth", type=_depth_cm, default=3.0, metavar="CM", help="(default: %(default)s)")
    loadcell.add_argument(
        "--plate", type=_plate_cm, default=(3.0, 3.5, 0.4), metavar="WxH", help="or WxHxT, in cm (default: 3x3.5x0.4)"
    )
    loadcell.add_argument("--speed", type=_speed_m_s, default=0.1, metavar="M/S", help="of the stage (default: 0.1)")
    loadcell.add_argument("--compare", type=Path, metavar="FILE", help="summary.json of the flipper experiment")
    loadcell.add_argument("--seed", type=int, default=1, metavar="N", help="of the simulation")


def _plate_cm(text: str) -> tuple[float, float, float]:
    """3x3.5 or, with its thickness, 3x3.5x0.4."""
    sides = text.lower().removesuffix("cm").split("x")
    if len(sides) not in (2, 3):
        raise argparse.ArgumentTypeError(f"{text}: must be width x height, or width x height x thickness, in cm")
    width, height, thickness = (float(side) for side in [*sides, "0.4"][:3])
    if not (0.2 <= width <= 50.0 and 0.2 <= height <= 50.0 and 0.02 <= thickness <= 10.0):
        raise argparse.ArgumentTypeError(f"{text}: width and height must be from 0.2 to 50, thickness from 0.02 to 10")
    return width, height, thickness


def _speed_m_s(text: str) -> float:
    value = float(text)
    if not 0.001 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text}: must be from 0.001 to 1 m/s")
    return value


def _baud(text: str) -> int:
    value = int(text)
    if not 300 <= value <= 4000000:
        raise argparse.ArgumentTypeError(f"{text}: must be from 300 to 4000000")
    return value


def _positive(text: str) -> float:
    value = float(text)
    if not (value > 0.0 and isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text}: must be more than 0")
    return value


def _compartment_m(text: str) -> float:
    value = float(text)
    if not 0.2 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text}: must be from 0.2 to 100")
    return value


def _seeds(text: str) -> int:
    value = int(text)
    if not 1 <= value <= 1000:
        raise argparse.ArgumentTypeError(f"{text}: must be from 1 to 1000")
    return value


def _strength_pa(text: str) -> float:
    value = float(text)
    if not 50.0 <= value <= 50000.0:
        raise argparse.ArgumentTypeError(f"{text}: must be from 50 to 50000 Pa")
    return value


def main(arguments: Sequence[str] | None = None) -> int:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no ± or ³ shows a question mark
    try:
        options = build_parser().parse_args(arguments)
        module, function = options.place.split(".")
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
        complain(f"{problem.filename or ''}: {problem.strerror or problem}".lstrip(": "))
        return exit_codes.UNHEALTHY


if __name__ == "__main__":
    sys.exit(main())
