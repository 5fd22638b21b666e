"""Writes a new configuration file: what differs from robot to robot, each key with its unit, bounds and meaning.

The comments are those of the configuration reference, so they cannot differ from what the reader enforces. Depths and
the motor's force follow from the geometry: the defaults of another robot could be out of its reach.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from math import floor
from typing import Any, NamedTuple

from command_line.init.key_reference import Key, configuration_keys, toml_value
from control.geometry import FlipperGeometry
from control.parameters.adaptation_parameters import AdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.parameters.joint_gains import GAINS_OF_ASKED_DRIVES
from control.parameters.joint_limits import JointLimits
from control.records import TWO_FLIPPERS, Rig
from drivers.drive_types import DEFAULT, DRIVE_TYPES

FD_RATE_KBIT_S = 5000  # of the data, where the drives use CAN FD
HEAD = """\
# Configuration of one robot, written by `mudskipper init`. Every key that is left out has its default; the reference in
# the documentation lists all. Before the first walk: measure the geometry, and run `mudskipper calibrate`.
"""


class NewRobot(NamedTuple):
    """The answers from which a file is written."""

    name: str = "mudskipper"
    rig: Rig = TWO_FLIPPERS
    base: str = "free"  # or on a rail, or fixed
    drive_type: str = DEFAULT
    interface: str = "socketcan"
    channels: tuple[str, ...] = ("can0",)  # one for all flippers, or one for each
    node_ids: Mapping[str, int] = {}  # by joint; the others are counted up
    geometry: FlipperGeometry = FlipperGeometry()
    serial_numbers: Mapping[str, str] = {}  # by joint, where they are known
    models: Mapping[str, str] = {}  # of the motors, by joint, where the drives have them

    def node_id(self, joint: str) -> int:
        lowest = next(key.bounds for key in drive_keys(self.drive_type) if key.name == "node_id" and key.bounds).minimum
        return self.node_ids.get(joint, int(lowest) + self.rig.joints.index(joint))

    def bus_of(self, flipper: str) -> str:
        return flipper if len(self.channels) > 1 else "can"


def drive_keys(drive_type: str) -> list[Key]:
    """Return the keys of a drive's own table, in which its records have tables of their own."""
    keys = configuration_keys(DRIVE_TYPES[drive_type].parameters, "drive.NAME")
    return [key for key in keys if key.section == "drive.NAME"]


def new_file(robot: NewRobot) -> str:
    """Return the text of the file."""
    return HEAD + "".join(f"\n{section}" for section in _sections(robot))


def _sections(robot: NewRobot) -> Iterator[str]:
    keys = list(configuration_keys())
    for section, values in _common(robot).items():
        yield _section(section, values, [key for key in keys if key.section == section])
    bus_keys = [key for key in keys if key.section == "bus.NAME"]
    for name, values in _buses(robot).items():
        yield _section(f"bus.{name}", values, bus_keys)
    for flipper in robot.rig.flippers:
        for joint in robot.rig.joints[robot.rig.joints_of(flipper)]:
            drive = {"bus": robot.bus_of(flipper), "node_id": robot.node_id(joint), "type": robot.drive_type}
            defaults = {key.name: key.default for key in drive_keys(robot.drive_type)}
            wanted = ("sign", "zero_turn", "torque_constant_nm_a", "current_limit_a")
            values = drive | {name: defaults[name] for name in wanted} | _identity(robot, joint)
            yield _section(f"drive.{joint}", values, drive_keys(robot.drive_type))


def _identity(robot: NewRobot, joint: str) -> dict[str, str]:
    """Return what was found of one drive; a serial number of zeros is none."""
    found = {"model": robot.models.get(joint, ""), "serial_number": robot.serial_numbers.get(joint, "")}
    return {name: text for name, text in found.items() if text.strip("0")}


def _common(robot: NewRobot) -> dict[str, dict[str, Any]]:
    alone = robot.base == "fixed" and len(robot.rig.flippers) == 1
    asked = DRIVE_TYPES[robot.drive_type].parameters.answers_only
    return {
        "robot": {"name": robot.name},
        "rig": {"flippers": robot.rig.flippers},
        "geometry": _geometry(robot.geometry),
        "gait": {"protocol": "single_flipper" if alone else "walking"},
        **({"gains": asdict(GAINS_OF_ASKED_DRIVES)} if asked else {}),
        "estimation": {"fixed_base": robot.base == "fixed", "free_body": robot.base == "free"},
        "adaptation": _adaptation(robot.geometry),
    }


def _geometry(geometry: FlipperGeometry) -> dict[str, Any]:
    """Return the keys of a rectangle, or of a plate with corners."""
    left_out = ("plate_width_m", "plate_height_m") if geometry.plate_corners_m else ("plate_corners_m",)
    return {name: value for name, value in asdict(geometry).items() if name not in left_out}


def _adaptation(geometry: FlipperGeometry) -> dict[str, Any]:
    usual, reached_m = AdaptationParameters(), geometry.deepest_m(GaitParameters().sweep_angle_deg)
    deepest_m = min(usual.max_depth_m, floor(1000.0 * reached_m) / 1000.0)
    most_n = floor(100.0 * JointLimits().torque_nm / geometry.flipper_length_m) / 100.0
    return {
        "initial_depth_m": min(usual.initial_depth_m, deepest_m),
        "min_depth_m": min(usual.min_depth_m, deepest_m),
        "max_depth_m": deepest_m,
        "body_mass_kg": usual.body_mass_kg,
        "motor_force_n": min(usual.motor_force_n, most_n),
    }


def _buses(robot: NewRobot) -> dict[str, dict[str, Any]]:
    names = dict.fromkeys(map(robot.bus_of, robot.rig.flippers))
    buses: dict[str, dict[str, Any]] = {
        name: {"interface": robot.interface, "channel": channel}
        for name, channel in zip(names, robot.channels, strict=True)
    }
    if DRIVE_TYPES[robot.drive_type].kind.is_fd:
        for bus in buses.values():
            bus["data_bit_rate_kbit_s"] = FD_RATE_KBIT_S
    return buses


def _section(name: str, values: Mapping[str, Any], keys: list[Key]) -> str:
    described = {key.name: key for key in keys}
    lines = (f"{f'{key} = {toml_value(value)}':<35} {_comment(described.get(key))}" for key, value in values.items())
    return f"[{name}]\n" + "".join(f"{line.rstrip()}\n" for line in lines)


def _comment(key: Key | None) -> str:
    if key is None:
        return ""
    bounds = f"{key.bounds.minimum:.10g} to {key.bounds.maximum:.10g}" if key.bounds else ""
    facts = ", ".join(filter(None, (key.unit, bounds)))
    return f"# {key.meaning}{f' ({facts})' if facts else ''}"
