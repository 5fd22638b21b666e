"""`mudskipper drives setup`: compares the drives' settings with the configuration, and writes those that differ."""

import argparse
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from command_line import exit_codes
from command_line.drives.backup_file import Backup, default_path, read_backup, write_backup
from command_line.drives.joint_setup import JointSetup, bus_problems, lines_of, read_documents, read_joint
from command_line.drives.opened_buses import OpenedBus, opened_buses
from command_line.screen import GREEN, RED, coloured, complain, watched
from drivers.bench.bench_port import NoAnswerError
from drivers.bench.settings_change import Names, Outcome, change_settings
from drivers.drive_types import DRIVE_BENCHES
from firmware_host.buses import BusError
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration

ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
Changes = Mapping[str, Mapping[str, float]]  # by joint and key


class RefusedError(Exception):
    """Nothing was written; the message says why."""


def setup(options: argparse.Namespace) -> int:
    if options.write and options.backup and options.backup.exists():
        complain(f"--backup {options.backup}: exists, and may have the only old settings; name another file")
        return exit_codes.USAGE
    try:
        configuration = load_configuration(options.config)
        backups = _backups(options)
        joints = _joints(options, configuration, backups)
        documents = read_documents(options.endpoints, options.config)
        buses = {name: configuration.bus[name] for name in {configuration.drive[each].bus: 0 for each in joints}}
        with opened_buses(buses) as opened:
            setups = _read(opened, configuration, joints, documents)
            return _act(options, setups, backups)
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    except (BusError, NoAnswerError, RefusedError) as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY


def _backups(options: argparse.Namespace) -> dict[str, Backup]:
    """Returns the file to restore, or the one to compare with; none where it is to be written."""
    if options.restore:
        return read_backup(options.restore)
    return read_backup(options.backup) if options.backup and not options.write else {}


def _joints(options: argparse.Namespace, configuration: Configuration, backups: Mapping[str, Backup]) -> list[str]:
    known = configuration.rig.joints
    for joint in [*options.joint, *backups]:
        if joint not in known:
            raise ConfigurationError([f"{joint}: this robot has {', '.join(known)}"])
    for joint in options.joint:
        if backups and joint not in backups:
            raise ConfigurationError([f"{joint}: the file has {', '.join(backups)}"])
    wanted = options.joint or backups or known
    joints = [joint for joint in known if joint in wanted]
    for joint in joints:
        if configuration.drive[joint].type not in DRIVE_BENCHES:
            problem = f"drive.{joint}.type = {configuration.drive[joint].type!r}: cannot be set up over CAN"
            raise ConfigurationError([f"{problem}; name the other joints"])
    return joints


def _read(
    opened: Sequence[OpenedBus], configuration: Configuration, joints: Sequence[str], documents: Sequence[object]
) -> list[JointSetup]:
    """Raises RefusedError where a drive is not the configured one, before anything else is asked."""
    buses = {bus.name: bus for bus in opened}
    with watched() as show:
        problems = [each for bus in opened for each in bus_problems(bus, configuration, joints, show)]
        if problems:
            complain(*problems)
            raise RefusedError("nothing was read or written: correct this first; 'mudskipper drives find' lists all")
        return [
            read_joint(joint, buses[configuration.drive[joint].bus], configuration, documents, show) for joint in joints
        ]


def _act(options: argparse.Namespace, setups: Sequence[JointSetup], backups: Mapping[str, Backup]) -> int:
    for each in setups:
        print("\n".join(lines_of(each)), end="\n\n")
    if options.restore:
        return _write(setups, _restoring(setups, backups), Names("former", "restored"))
    for each in setups:
        if each.joint in backups:
            print(f"{each.joint} {backups[each.joint].state(each.values)} of {options.backup}")
    changes = {each.joint: each.wanted for each in setups if each.wanted}
    if options.write and changes:
        path = options.backup or default_path()
        write_backup(path, [each for each in setups if each.joint in changes], changes)
        print(f"the old settings are in {path}")
        return _write(setups, changes, Names())
    return _summary(setups, options.write)


def _summary(setups: Sequence[JointSetup], written: bool) -> int:
    differing = sum(len(each.differing) for each in setups)
    unread = sum(len(each.unreadable) for each in setups)
    if differing or unread:
        hint = "" if written else "; 'mudskipper drives setup --write' writes those that may be written"
        print(f"{differing} settings differ, {unread} were not read{hint if differing else ''}")
        return exit_codes.UNHEALTHY
    cannot = sum(bool(each.drive.cannot) for each in setups)
    rest = f"; {cannot} of {len(setups)} drives have none that can be read over CAN" if cannot else ""
    print(coloured("ok", GREEN) + f"   every setting that can be read is as wanted{rest}")
    return exit_codes.OK


def _restoring(setups: Sequence[JointSetup], backups: Mapping[str, Backup]) -> Changes:
    """Returns the old values. Raises RefusedError where a file is of another drive."""
    for each in setups:
        backup, found = backups[each.joint], each.found
        if (backup.type, backup.serial_number) != (found.type, found.serial_number):
            text = f"{each.joint}: the file is of a drive of type {backup.type} with serial number"
            raise RefusedError(f"{text} {backup.serial_number or '-'}, not {found.serial_number or '-'}")
        print(f"{each.joint} {backup.state(each.values)}")
    return {each.joint: backups[each.joint].old for each in setups}


def _write(setups: Sequence[JointSetup], changes: Changes, names: Names) -> int:
    """Writes one drive at a time, and stops at the first that does not end with its new settings."""
    with deferred_ending() as interrupted, watched() as show:
        for done, each in enumerate(setups):
            show("drives written", done, len(setups))
            new = changes.get(each.joint, {})
            if not new:
                print(f"{each.joint} needs no change")
                continue
            old = {key: each.values[key] for key in new}
            change = change_settings(each.drive, old, new, interrupted, names)
            mark = coloured("ok  ", GREEN) if change.outcome is Outcome.NEW else coloured("FAIL", RED)
            print(f"{mark} {each.joint}: {change.text}", flush=True)
            if change.outcome is not Outcome.NEW or interrupted():
                print("the drives after it were not changed")
                return exit_codes.INTERRUPTED if interrupted() else exit_codes.UNHEALTHY
    return exit_codes.OK


@contextmanager
def deferred_ending() -> Iterator[Callable[[], bool]]:
    """Yields whether a signal asked this program to end. Without this it would end between two settings."""
    asked = []
    before = {number: signal.signal(number, lambda number, frame: asked.append(number)) for number in ENDINGS}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
