"""`mudskipper init`: writes a configuration for a new robot, from questions on a terminal or from options."""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from command_line import exit_codes
from command_line.init.bus_scan import scan, with_found, with_identities
from command_line.init.key_reference import Key, configuration_keys
from command_line.init.new_file import NewRobot, drive_keys, new_file
from command_line.init.questions import Ask, ask, number, one_of, whole_number
from command_line.screen import complain
from control.geometry import FlipperGeometry
from control.plate_outline import Corner
from control.records import FLIPPERS, Rig
from drivers.drive_types import DRIVE_TYPES
from experiments.campaign.plate_file import read_corners
from firmware_host.buses import BusError
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration

PRINTED = Path("-")
RECTANGLE = "rectangle"
SIDES = ("plate_width_m", "plate_height_m")


def init(options: argparse.Namespace) -> int:
    can_ask = sys.stdin.isatty() and not options.defaults
    if options.file != PRINTED and options.file.exists():
        complain(f"{options.file} exists: name another file, or move it away")
        return exit_codes.USAGE
    try:
        text = new_file(answers(options, input if can_ask else None))
        parse_configuration(text)
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    except BusError as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    except EOFError:
        return exit_codes.INTERRUPTED
    if options.file == PRINTED:
        print(text, end="")
        return exit_codes.OK
    with options.file.open("x", encoding="utf-8") as file:
        file.write(text)
    print(f"written  {options.file}\ncheck it with: mudskipper doctor --config {options.file}")
    return exit_codes.OK


def answers(options: argparse.Namespace, read: Ask | None) -> NewRobot:
    """Returns the robot of the options; `read` asks for what is left open. Raises ConfigurationError and BusError."""
    default = NewRobot()
    name = options.name or ask("name of the robot", default.name, str, read)
    wanted = options.flippers or ask("flippers: left, right or both", "both", one_of((*FLIPPERS, "both")), read)
    rig = Rig(FLIPPERS if wanted == "both" else (wanted,))
    base = options.base or ask("base: fixed or moves", "moves", one_of(("fixed", "moves")), read)
    if options.from_bus:
        return _from_bus(options, NewRobot(name, rig, base == "fixed"), read)
    types = tuple(DRIVE_TYPES)
    drive_type = options.drive or ask(f"drives: {' or '.join(types)}", default.drive_type, one_of(types), read)
    interface = options.interface or ask("interface of python-can", default.interface, str, read)
    robot = NewRobot(name, rig, base == "fixed", drive_type, interface, _channels(options, rig, read))
    return robot._replace(node_ids=_node_ids(options, robot, read), geometry=_geometry(options, read))


def _from_bus(options: argparse.Namespace, robot: NewRobot, read: Ask | None) -> NewRobot:
    """Scans the buses, and asks which drive moves which joint. Raises ConfigurationError and BusError."""
    interface = options.interface or ask("interface of python-can", robot.interface, str, read)
    robot = robot._replace(interface=interface, channels=_channels(options, robot.rig, read))
    found = scan(robot, options.fd, options.drive)
    for channel, drives in found.items():
        print(f"found on {channel}: {', '.join(f'{each.type} {each.node_id}' for each in drives)}", file=sys.stderr)
    robot = with_found(robot, found, dict(options.node or ()))
    robot = robot._replace(node_ids=_node_ids(options, robot, read))
    return with_identities(robot, found)._replace(geometry=_geometry(options, read))


def _channels(options: argparse.Namespace, rig: Rig, read: Ask | None) -> tuple[str, ...]:
    """Raises ConfigurationError."""
    text = "its channels, one for all flippers or one for each" if len(rig.flippers) > 1 else "its channel"
    channels = tuple(options.channel or ask(text, "can0", str, read).replace(",", " ").split())
    if len(channels) not in (1, len(rig.flippers)):
        possible = " or ".join(map(str, sorted({1, len(rig.flippers)})))
        raise ConfigurationError([f"{len(channels)} channels, {', '.join(channels)}: must be {possible} for this rig"])
    return channels


def _node_ids(options: argparse.Namespace, robot: NewRobot, read: Ask | None) -> dict[str, int]:
    """Raises ConfigurationError."""
    given = dict(options.node or ())
    for joint in given.keys() - set(robot.rig.joints):
        raise ConfigurationError([f"--node {joint}: this rig has {', '.join(robot.rig.joints)}"])
    bounds = next(key.bounds for key in drive_keys(robot.drive_type) if key.name == "node_id")
    assert bounds is not None
    return {
        joint: given[joint]
        if joint in given
        else ask(f"node id of {joint}", robot.node_id(joint), whole_number(*bounds), read)
        for joint in robot.rig.joints
    }


def _geometry(options: argparse.Namespace, read: Ask | None) -> FlipperGeometry:
    """Raises ConfigurationError."""
    given = dict(options.set or ())
    corners = _corners(options, given, read)
    left_out = {"plate_corners_m", *(SIDES if corners else ())}
    keys = {key.name: key for key in configuration_keys(FlipperGeometry, "geometry") if key.name not in left_out}
    values = {name: given[name] if name in given else _ask_value(key, read) for name, key in keys.items()}
    return FlipperGeometry(plate_corners_m=corners, **values)


def _corners(options: argparse.Namespace, given: Mapping[str, float], read: Ask | None) -> tuple[Corner, ...]:
    """Returns the plate's corners; none for a rectangle. Raises ConfigurationError."""
    sides = [name for name in SIDES if name in given]
    if options.plate and sides:
        raise ConfigurationError([f"--set {sides[0]}: must be left out where --plate gives the plate's corners"])
    prompt = f"plate: {RECTANGLE}, or a file of its corners"
    plate = options.plate or (RECTANGLE if sides else ask(prompt, RECTANGLE, _plate_answer, read))
    try:
        return () if plate == RECTANGLE else read_corners(Path(plate))
    except ValueError as problem:
        raise ConfigurationError([str(problem)]) from problem


def _plate_answer(line: str) -> str:
    """Accepts `rectangle` or a file of corners. Raises ValueError."""
    if line != RECTANGLE:
        read_corners(Path(line))
    return line


def _ask_value(key: Key, read: Ask | None) -> float:
    assert key.bounds is not None
    return ask(f"{key.name}: {key.meaning} ({key.unit})", float(key.default), number(*key.bounds), read)
