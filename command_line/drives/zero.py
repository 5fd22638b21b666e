"""`mudskipper drives zero`: makes a joint's present position its angle zero, in the configuration file.

The drive keeps its own zero; `zero_turn` is the encoder's reading where the joint's angle is zero. The position is read
by the daemon's own driver with a closed transmit gate, so sign and protocol are those of the walk.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import degrees, isfinite, pi
from typing import Annotated, NamedTuple

from command_line import exit_codes
from command_line.drives.opened_buses import opened_buses
from command_line.errors import CommandError, usage_error
from command_line.robot_options import RobotConfiguration
from command_line.screen import complain, watched
from control.computing.suggestion import suggestion
from drivers.bench.bench_port import BenchPort
from drivers.drive_types import make_drives
from drivers.drives import Drives
from experiments.actuator.file_change import Changes, FileChangeError, change_file
from experiments.study.option import Option
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import read_text

HEARING_S, READING_S = 1.0, 1.0
POLL_S = 0.005
FEWEST_READINGS = 20
LARGEST_MOTION_DEG = 0.3  # several steps of the coarsest encoder code (MIT mode: 0.02°), with its noise
DIGITS = 5  # of a turn: 0.004°


class Reading(NamedTuple):
    joint: str
    old_turn: float
    new_turn: float
    angle_deg: float  # of the joint, by the old zero
    motion_deg: float  # between the extremes


def zero(
    joint: Annotated[tuple[str, ...], Option("such as left_sweep", metavar="JOINT", offers="{joint}")],
    *,
    config: RobotConfiguration,
    yes: Annotated[bool, Option("write it without asking")] = False,
) -> int:
    text = read_text(config)
    configuration = parse_configuration(text, config)
    for name in joint:
        if name not in configuration.rig.joints:
            raise usage_error(f"{name}: this robot has no such joint; {suggestion(name, configuration.rig.joints)}")
    readings = _read(configuration, list(dict.fromkeys(joint)))
    moved = [each for each in readings if each.new_turn != each.old_turn]
    for each in readings:
        print(
            f"{each.joint}: zero_turn {each.old_turn:g} -> {each.new_turn:g}; the joint stood at"
            f" {each.angle_deg:.2f}°, and moved by {each.motion_deg:.3f}°"
        )
    status = exit_codes.OK

    def agrees(difference: str) -> bool:
        nonlocal status
        print(difference)
        if not (is_agreed := yes or _agreed(f"Write this to {config}? [y/N] ")):
            status = exit_codes.REFUSED if sys.stdin.isatty() else exit_codes.USAGE
        return is_agreed

    changes: Changes = {("drive", each.joint, "zero_turn"): each.new_turn for each in moved}
    try:
        print(change_file(config, text, changes, agrees))
    except FileChangeError as problem:
        raise CommandError(str(problem)) from None
    return status


def _agreed(question: str) -> bool:
    if not sys.stdin.isatty():
        complain("there is no terminal on which to ask: add --yes to write it")
        return False
    with suppress(EOFError):
        return input(question).strip().lower() in ("y", "yes")
    return False


def _read(configuration: Configuration, joints: Sequence[str]) -> list[Reading]:
    """Read all joints at once. Raises BusError and CommandError."""
    names = {configuration.drive[joint].bus for joint in joints}
    chosen = {joint: configuration.drive[joint] for joint in configuration.rig.joints if joint in joints}
    with opened_buses({name: configuration.bus[name] for name in configuration.bus if name in names}) as opened:
        ports = {bus.name: bus.can_port for bus in opened}
        drives = make_drives(chosen, ports, configuration.limits, configuration.watchdog_endpoints)
        with watched() as show:
            angles_rad = read_angles(drives, opened[0].port, show)
    return [_reading(joint, chosen[joint].zero_turn, chosen[joint].sign, angles_rad[joint]) for joint in chosen]


def read_angles(
    drives: Drives, clock: BenchPort, show: Callable[[str, int, int], None]
) -> Mapping[str, Sequence[float]]:
    """Return the new readings of every joint's angle for READING_S. Raises CommandError."""
    begun_s = clock.now_s
    states = drives.read(begun_s)
    while not drives.heard and clock.now_s - begun_s < HEARING_S:
        drives.poll()
        clock.sleep(POLL_S)
        states = drives.read(clock.now_s)
    found: dict[str, list[float]] = {axis.joint: [] for axis in drives.axes}
    stamps_s = dict.fromkeys(found, 0.0)
    begun_s = clock.now_s
    while (elapsed_s := clock.now_s - begun_s) < READING_S:
        show("ms read", round(1e3 * elapsed_s), round(1e3 * READING_S))
        drives.poll()
        clock.sleep(POLL_S)
        states = drives.read(clock.now_s)
        for axis, state in zip(drives.axes, states, strict=True):
            if state.closed_loop:
                raise CommandError(f"{axis.joint}: its drive follows torque; nothing was written")
            if state.angle_stamp_s != stamps_s[axis.joint] and isfinite(state.angle_rad):
                stamps_s[axis.joint] = state.angle_stamp_s
                found[axis.joint].append(state.angle_rad)
    return found


def _reading(joint: str, zero_turn: float, sign: int, angles_rad: Sequence[float]) -> Reading:
    if len(angles_rad) < FEWEST_READINGS:
        text = f"{joint}: {len(angles_rad)} readings of its position in {READING_S:g} s, {FEWEST_READINGS} are needed"
        raise CommandError(f"{text}; check its power, wiring and id with 'mudskipper drives find'")
    motion_deg = degrees(max(angles_rad) - min(angles_rad))
    if motion_deg > LARGEST_MOTION_DEG:
        text = f"{joint} moved by {motion_deg:.2f}° within {READING_S:g} s, more than {LARGEST_MOTION_DEG:g}°"
        raise CommandError(f"{text}: hold it still, and run the command again")
    mean_rad = sum(angles_rad) / len(angles_rad)
    new_turn = round(zero_turn + sign * mean_rad / (2.0 * pi), DIGITS)
    return Reading(joint, zero_turn, new_turn, degrees(mean_rad), motion_deg)
