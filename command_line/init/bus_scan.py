"""Fills a new robot with the drives that answer on its buses: type, ids, serial numbers, models.

Which drive moves which joint is not on the bus: ids are given to the joints in ascending order, on each bus alone, and
the operator can answer otherwise.
"""

from collections.abc import Mapping, Sequence

from command_line.drives.opened_buses import FD_RATE_KBIT_S, opened_buses
from command_line.init.new_file import NewRobot
from command_line.screen import watched
from drivers.bench.drive_setup import FoundDrive
from drivers.bench.search import drive_problems, id_problems
from drivers.drive_types import DRIVE_BENCHES
from firmware_host.configuration.configuration import BusParameters
from firmware_host.configuration.file_problems import ConfigurationError

Found = Mapping[str, Sequence[FoundDrive]]  # by channel


def scan(robot: NewRobot, carries_fd: bool, drive_type: str | None) -> Found:
    """Raises BusError, and ConfigurationError where a drive cannot be used as it is."""
    if drive_type and drive_type not in DRIVE_BENCHES:
        raise ConfigurationError([f"--drive {drive_type}: --from-bus finds {', '.join(DRIVE_BENCHES)}"])
    carries_fd = carries_fd or bool(drive_type and DRIVE_BENCHES[drive_type].is_fd)
    rate_kbit_s = FD_RATE_KBIT_S if carries_fd else 0
    buses = {name: BusParameters(robot.interface, name, {}, 1000, rate_kbit_s) for name in robot.channels}
    with opened_buses(buses) as opened, watched() as show:
        results = {bus.name: bus.search((drive_type,) if drive_type else (), show) for bus in opened}
    problems = [
        f"{channel}: {text}"
        for channel, result in results.items()
        for text in (*id_problems(result.found), *drive_problems(result.found))
    ]
    types = sorted({each.type for result in results.values() for each in result.found})
    if len(types) > 1:
        problems.append(f"the buses have drives of the types {', '.join(types)}: name one with --drive")
    if problems:
        raise ConfigurationError(problems)
    return {channel: result.found for channel, result in results.items()}


def with_found(robot: NewRobot, found: Found, given: Mapping[str, int]) -> NewRobot:
    """Return the robot with the type and the ids of the drives. Raises ConfigurationError where they do not fit."""
    types = [each.type for drives in found.values() for each in drives]
    node_ids: dict[str, int] = {}
    for channel, drives in found.items():
        joints = _joints_on(robot, channel)
        ids = sorted(each.node_id for each in drives)
        named = sum(joint in given for joint in joints)
        if len(ids) < len(joints) or len(ids) > len(joints) and named < len(joints):
            text = f"{channel}: {len(ids)} drives answer ({', '.join(map(str, ids)) or 'none'})"
            more = ": name each joint's with --node" if len(ids) > len(joints) else ": check power, wiring and ids"
            raise ConfigurationError([f"{text} for the {len(joints)} joints on it{more}"])
        left = [joint for joint in joints if joint not in given]
        taken = {given[joint] for joint in joints if joint in given}
        node_ids |= dict(zip(left, (each for each in ids if each not in taken), strict=False))
    return robot._replace(drive_type=types[0], node_ids=node_ids | dict(given))


def with_identities(robot: NewRobot, found: Found) -> NewRobot:
    """Return the robot with serial numbers and models, by its ids. Raises ConfigurationError for an id without one."""
    serial_numbers, models = {}, {}
    for channel, drives in found.items():
        by_id = {each.node_id: each for each in drives}
        for joint in _joints_on(robot, channel):
            drive = by_id.get(robot.node_id(joint))
            if drive is None:
                raise ConfigurationError([f"{joint}: no drive answers under id {robot.node_id(joint)} on {channel}"])
            serial_numbers[joint], models[joint] = drive.serial_number, drive.model
    return robot._replace(serial_numbers=serial_numbers, models=models)


def _joints_on(robot: NewRobot, channel: str) -> Sequence[str]:
    if len(robot.channels) == 1:
        return robot.rig.joints
    flipper = robot.rig.flippers[robot.channels.index(channel)]
    return robot.rig.joints[robot.rig.joints_of(flipper)]
