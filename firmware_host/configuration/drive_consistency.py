"""Checks that every joint has a drive of its own, which can exert the torque, on a bus that carries its frames."""

import re
from collections.abc import Iterator
from dataclasses import replace

from control.computing.suggestion import suggestion
from control.records import FLIPPERS
from drivers.can.can_fd import CLASSIC_INTERFACES
from drivers.drive_types import collisions, type_of
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.toml_records import shown


def rig_problems(configuration: Configuration) -> Iterator[str]:
    """Check that every joint of the rig has a drive, and nothing is configured for a joint that it lacks."""
    flippers, joints = list(configuration.rig.flippers), configuration.rig.joints
    if not flippers or flippers != [flipper for flipper in FLIPPERS if flipper in flippers]:
        yield f"rig.flippers = {flippers}: must be {[FLIPPERS[0]]}, {[FLIPPERS[1]]} or {list(FLIPPERS)}"
        return
    found = ", ".join(configuration.drive) or "none"
    for joint in joints:
        if joint not in configuration.drive:
            yield (
                f"drive.{joint} is missing: rig.flippers = {flippers} needs a drive for each of {', '.join(joints)},"
                f" and there is {found}; add [drive.{joint}], or take its flipper out of rig.flippers"
            )
    for section, table in (("drive", configuration.drive), ("friction", configuration.friction)):
        for joint in (joint for joint in table if joint not in joints):
            yield (
                f"{section}.{joint}: there is no such joint with rig.flippers = {flippers}; {suggestion(joint, joints)}"
            )


def drive_problems(configuration: Configuration) -> Iterator[str]:
    wires = _wires(configuration)
    wired = {joint: replace(each, bus=wires.get(each.bus, each.bus)) for joint, each in configuration.drive.items()}
    joint_at: dict[tuple[str, int], str] = {}
    for joint, drive in configuration.drive.items():
        if drive.bus not in configuration.bus:
            yield f"drive.{joint}.bus = {drive.bus!r}: there is no such bus; {suggestion(drive.bus, configuration.bus)}"
        if drive.sign == 0:
            yield f"drive.{joint}.sign = 0: must be 1 or -1"
        duplicate = joint_at.setdefault((wired[joint].bus, drive.node_id), joint)
        if duplicate != joint:
            first_bus = configuration.drive[duplicate].bus
            shared = "" if first_bus == drive.bus else ", the same channel"
            yield f"drive.{joint}.node_id = {drive.node_id}: {duplicate} has the same on bus {first_bus!r}{shared}"
        digits = drive.serial_digits
        if not re.fullmatch(f"([0-9a-f]{{{digits}}})?", drive.serial_number):
            must = f"must be {digits} hexadecimal digits in lower case" if digits else "must be empty: it reports none"
            yield f"drive.{joint}.serial_number = {drive.serial_number!r}: {must}"
        torque_problems = drive.torque_problems(configuration.limits.torque_nm)  # it would clamp without a report
        for value, problem in (*torque_problems, *drive.record_problems()):
            yield f"drive.{joint}.{value}: {problem}"
    for first, second, identifier in collisions(wired):
        one, other = configuration.drive[first], configuration.drive[second]
        if one.node_id != other.node_id:
            yield (
                f"drive.{second}.node_id = {other.node_id}: as {other.type} it uses the arbitration id"
                f" 0x{identifier:03x} on bus {one.bus!r}, and so does drive.{first}.node_id = {one.node_id} as"
                f" {one.type}; give one of them another id, or put them on two buses"
            )


def _wires(configuration: Configuration) -> dict[str, str]:
    """Return what identifies the channel of each bus, which two sections may have in common."""
    return {
        name: f"{bus.interface} {bus.channel} {shown(sorted(bus.options.items()))}"
        for name, bus in configuration.bus.items()
    }


def bus_problems(configuration: Configuration) -> Iterator[str]:
    """Check that each bus carries the frames of its drives, and that these do not disturb each other."""
    wires = _wires(configuration)
    for name, bus in configuration.bus.items():
        drives = {f"drive.{j}": each for j, each in configuration.drive.items() if wires.get(each.bus) == wires[name]}
        kinds = {key: type_of(drive).kind for key, drive in drives.items()}
        fd = next((key for key, kind in kinds.items() if kind.is_fd and drives[key].bus == name), "")
        classic = next((key for key, kind in kinds.items() if not kind.is_fd), "")
        if fd and classic:
            yield (
                f"{fd}.type = {drives[fd].type!r}: uses CAN FD, which disturbs {classic} ({drives[classic].type}) on"
                f" the same channel {bus.channel!r}; put them on two buses"
            )
        elif fd and bus.interface in CLASSIC_INTERFACES:
            yield (
                f"bus.{name}.interface = {bus.interface!r}: carries no CAN FD, which {fd} ({drives[fd].type}) needs;"
                " use an adapter with SocketCAN and CAN FD"
            )
        elif fd and not bus.data_bit_rate_kbit_s:
            yield (
                f"bus.{name}.data_bit_rate_kbit_s = 0: must be that of {fd} ({drives[fd].type}), which uses CAN FD,"
                " such as 5000"
            )
