"""`mudskipper init`: writes a configuration for a new robot, from questions on a terminal or from options."""

import argparse
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import redirect_stdout, suppress
from dataclasses import fields
from math import isfinite
from pathlib import Path
from typing import Annotated, Protocol, TypeVar

from command_line import exit_codes
from command_line.errors import usage_error
from command_line.init.bus_scan import scan, with_found, with_identities
from command_line.init.key_reference import Key, configuration_keys
from command_line.init.new_file import NewRobot, drive_keys, new_file
from command_line.robot_options import interface_name
from control.computing.suggestion import suggestion
from control.geometry import FlipperGeometry
from control.plate_outline import Corner
from control.records import FLIPPERS, JOINTS, Rig
from drivers.drive_types import DEFAULT, DRIVE_TYPES
from experiments.campaign.plate_file import read_corners
from experiments.study.option import Option
from firmware_host.configuration.file_problems import ConfigurationError, UnreadableFileError
from firmware_host.configuration.loading import parse_configuration

T = TypeVar("T")
PRINTED = Path("-")
FLIPPER_SETS = (*FLIPPERS, "both")
BASES = ("fixed", "rail", "free")
RECTANGLE = "rectangle"
SIDES = ("plate_width_m", "plate_height_m")


def node_id(text: str) -> tuple[str, int]:
    """Parse a joint and its id."""
    joint, _, number = text.partition("=")
    if joint not in JOINTS or not number.isdecimal():
        raise argparse.ArgumentTypeError(f"{text}: must be a joint and its id, such as {JOINTS[0]}=0")
    return joint, int(number)


def geometry_value(text: str) -> tuple[str, float]:
    """Parse a key of [geometry] with its value in m or degrees, whose bounds the configuration checks."""
    key, _, value = text.partition("=")
    names = [field.name for field in fields(FlipperGeometry) if field.name != "plate_corners_m"]
    with suppress(ValueError):
        if key in names and isfinite(float(value)):
            return key, float(value)
    raise argparse.ArgumentTypeError(f"{text}: must be one of {', '.join(names)} with its value, as in drop_m=0.05")


NodeIds = Annotated[
    tuple[tuple[str, int], ...],
    Option("right_sweep=3", metavar="JOINT=ID", parse=node_id, keyed=True, offers="{joint}="),
]
PlateFile = Annotated[
    str | None, Option("corners of a plate that is no rectangle: lines of outward, upward in m", metavar="FILE")
]
GeometryValues = Annotated[
    tuple[tuple[str, float], ...], Option("geometry: drop_m=0.05", metavar="KEY=M", parse=geometry_value, keyed=True)
]


def init(
    file: Annotated[Path, Option("new file; -: print", metavar="file")] = Path("mudskipper.toml"),
    *,
    defaults: Annotated[bool, Option("ask nothing")] = False,
    name: Annotated[str | None, Option("of the robot, in its logs")] = None,
    flippers: Annotated[str | None, Option("one with two motors, or both with four", choices=FLIPPER_SETS)] = None,
    base: Annotated[str | None, Option("a bench, a body on a rail, or a free body", choices=BASES)] = None,
    drive: Annotated[str | None, Option("protocol of the drives", choices=tuple(DRIVE_TYPES))] = None,
    interface: Annotated[str | None, Option("of python-can, such as socketcan", parse=interface_name)] = None,
    from_bus: Annotated[bool, Option("search its channels for drives, and write what is found")] = False,
    fd: Annotated[bool, Option("with --from-bus: it carries CAN FD")] = False,
    channel: Annotated[tuple[str, ...], Option("such as can0; twice: the left and the right flipper's own")] = (),
    node: NodeIds = (),
    plate: PlateFile = None,
    set: GeometryValues = (),
) -> int:
    """Ask for what no option gives; without a terminal, or with `defaults`, the default is the answer."""
    if file != PRINTED and file.exists():
        raise usage_error(f"{file} exists: name another file, or move it away")
    if fd and not from_bus:
        raise usage_error("--fd belongs to --from-bus; without it --drive says whether the buses carry CAN FD")
    ask = asked_on_terminal if sys.stdin.isatty() and not defaults else unasked
    try:
        name = name or ask("name of the robot", NewRobot().name, str)
        wanted = flippers or ask("flippers: left, right or both", "both", one_of(FLIPPER_SETS))
        base = base or ask("base: fixed, rail or free", NewRobot().base, one_of(BASES))
        robot = NewRobot(name, Rig(FLIPPERS if wanted == "both" else (wanted,)), base)
        if not from_bus:
            types = tuple(DRIVE_TYPES)
            robot = robot._replace(drive_type=drive or ask(f"drives: {' or '.join(types)}", DEFAULT, one_of(types)))
        interface = interface or ask("interface of python-can", robot.interface, interface_name)
        robot = robot._replace(interface=interface, channels=_channels(channel, robot.rig, ask))
        found = scan(robot, fd, drive) if from_bus else {}
        for each_channel, drives in found.items():
            names = ", ".join(f"{each.type} {each.node_id}" for each in drives)
            print(f"found on {each_channel}: {names}", file=sys.stderr)
        robot = with_found(robot, found, dict(node)) if found else robot
        robot = robot._replace(node_ids=_node_ids(dict(node), robot, ask))
        robot = with_identities(robot, found) if found else robot
        text = new_file(robot._replace(geometry=_geometry(plate, dict(set), ask)))
    except EOFError:
        return exit_codes.INTERRUPTED
    _write(file, text)
    return exit_codes.OK


def _write(file: Path, text: str) -> None:
    parse_configuration(text)
    if file == PRINTED:
        print(text, end="")
        return
    with file.open("x", encoding="utf-8") as opened:
        opened.write(text)
    print(f"written  {file}\ncheck it with: mudskipper doctor --config {file}")
    print(f"try it without its drives: mudskipper simulate --config {file} --local")


class Ask(Protocol):
    """Returns the parsed answer to a question, or the default."""

    def __call__(self, prompt: str, default: T, parse: Callable[[str], T]) -> T: ...


def unasked(prompt: str, default: T, parse: Callable[[str], T]) -> T:
    return default


def asked_on_terminal(prompt: str, default: T, parse: Callable[[str], T]) -> T:
    """Show the default in brackets, which an empty line takes; ask again after an answer that does not fit."""
    shown = f"{default:.10g}" if isinstance(default, float) else str(default)
    with redirect_stdout(sys.stderr):  # standard output may be the file
        while line := input(f"{prompt} [{shown}]: ").strip():
            try:
                return parse(line)
            except (ValueError, argparse.ArgumentTypeError) as problem:
                print(f"  {problem}")
    return default


def one_of(words: Collection[str]) -> Callable[[str], str]:
    def parse(line: str) -> str:
        if line not in words:
            raise ValueError(f"{line}: must be one of {', '.join(words)}")
        return line

    return parse


def _channels(given: Sequence[str], rig: Rig, ask: Ask) -> tuple[str, ...]:
    """Raises CommandError."""
    text = "its channels, one for all flippers or one for each" if len(rig.flippers) > 1 else "its channel"
    channels = tuple(given or ask(text, "can0", str).replace(",", " ").split())
    if len(channels) not in (1, len(rig.flippers)):
        possible = " or ".join(map(str, sorted({1, len(rig.flippers)})))
        raise usage_error(f"{len(channels)} channels, {', '.join(channels)}: must be {possible} for this rig")
    return channels


def _node_ids(given: Mapping[str, int], robot: NewRobot, ask: Ask) -> dict[str, int]:
    """Raises CommandError."""
    for joint in given.keys() - set(robot.rig.joints):
        raise usage_error(f"--node {joint}: this rig has no such joint; {suggestion(joint, robot.rig.joints)}")
    bounds = next(key.bounds for key in drive_keys(robot.drive_type) if key.name == "node_id")
    assert bounds is not None
    return {
        joint: given[joint]
        if joint in given
        else ask(f"node id of {joint}", robot.node_id(joint), Option("", *bounds).parse_whole_number)
        for joint in robot.rig.joints
    }


def _geometry(plate: str | None, given: Mapping[str, float], ask: Ask) -> FlipperGeometry:
    """Raises ConfigurationError."""
    corners = _corners(plate, given, ask)
    left_out = {"plate_corners_m", *(SIDES if corners else ())}
    keys = {key.name: key for key in configuration_keys(FlipperGeometry, "geometry") if key.name not in left_out}
    values = {name: given[name] if name in given else _ask_value(key, ask) for name, key in keys.items()}
    return FlipperGeometry(plate_corners_m=corners, **values)


def _corners(plate: str | None, given: Mapping[str, float], ask: Ask) -> tuple[Corner, ...]:
    """Return the plate's corners; none for a rectangle. Raises CommandError and ConfigurationError."""
    sides = [name for name in SIDES if name in given]
    if plate and sides:
        raise usage_error(f"--set {sides[0]}: must be left out where --plate gives the plate's corners")
    prompt = f"plate: {RECTANGLE}, or a file of its corners"
    plate = plate or (RECTANGLE if sides else ask(prompt, RECTANGLE, _plate_answer))
    try:
        return () if plate == RECTANGLE else read_corners(Path(plate))
    except ValueError as problem:
        kind = UnreadableFileError if isinstance(problem.__cause__, OSError) else ConfigurationError
        raise kind([str(problem)]) from problem


def _plate_answer(line: str) -> str:
    """Accept `rectangle` or a file of corners. Raises ValueError."""
    if line != RECTANGLE:
        read_corners(Path(line))
    return line


def _ask_value(key: Key, ask: Ask) -> float:
    assert key.bounds is not None
    option = Option(key.meaning, *key.bounds)
    return ask(f"{key.name}: {key.meaning} ({key.unit})", float(key.default), option.parse_number)
