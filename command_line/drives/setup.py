"""`mudskipper drives setup`: compares the drives' settings with the configuration, and writes those that differ."""

import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from command_line import exit_codes
from command_line.drives.backup_file import Backup, default_path, read_backup, write_backup
from command_line.drives.joint_setup import JointSetup, bus_problems, lines_of, read_documents, read_joint
from command_line.drives.opened_buses import OpenedBus, opened_buses
from command_line.errors import CommandError, usage_error
from command_line.robot_options import RobotConfiguration
from command_line.screen import GREEN, RED, coloured, watched
from control.computing.suggestion import suggestion
from drivers.bench.bench_port import NoAnswerError
from drivers.bench.settings_change import Names, Outcome, change_settings
from drivers.drive_types import DRIVE_BENCHES
from experiments.study.option import Option
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration

ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
Changes = Mapping[str, Mapping[str, float]]  # by joint and key


def setup(
    joint: Annotated[
        tuple[str, ...], Option("such as left_sweep (default: all)", metavar="JOINT", offers="{joint}")
    ] = (),
    *,
    config: RobotConfiguration,
    write: Annotated[bool, Option("write and store what differs, one drive at a time", alternative="write")] = False,
    restore: Annotated[Path | None, Option("write the old settings of this file again", alternative="write")] = None,
    backup: Annotated[Path | None, Option("with --write: new file for the old settings; else: compare with it")] = None,
    endpoints: Annotated[
        tuple[Path, ...],
        Option("flat_endpoints.json of an ODrive's build (default: those next to the configuration)"),
    ] = (),
) -> int:
    if restore and backup:
        raise usage_error("--backup: must be left out with --restore, which writes the settings of its own file")
    if write and backup and backup.exists():
        raise usage_error(f"--backup {backup}: exists, and may have the only old settings; name another file")
    configuration = load_configuration(config)
    compared = restore or (None if write else backup)
    backups = read_backup(compared) if compared else {}
    joints = _joints(joint or [], configuration, backups)
    documents = read_documents(endpoints, config)
    buses = {name: configuration.bus[name] for name in {configuration.drive[each].bus: 0 for each in joints}}
    try:
        with opened_buses(buses) as opened:
            setups = _read(opened, configuration, joints, documents)
            for each in setups:
                print("\n".join(lines_of(each)), end="\n\n")
            if restore:
                return _write(setups, _restoring(setups, backups), Names("former", "restored"))
            for each in setups:
                if each.joint in backups:
                    print(f"{each.joint} has {backups[each.joint].state(each.values)} of {backup}")
            changes = {each.joint: each.wanted for each in setups if each.wanted}
            if write and changes:
                path = backup or default_path()
                write_backup(path, [each for each in setups if each.joint in changes], changes)
                print(f"the old settings are in {path}")
                if status := _write(setups, changes, Names()):
                    return status
                setups = [each._replace(values={**each.values, **each.wanted}) for each in setups]
            return _summary(setups, write)
    except NoAnswerError as problem:
        raise CommandError(str(problem)) from None


def _joints(named: Sequence[str], configuration: Configuration, backups: Mapping[str, Backup]) -> list[str]:
    """Return the joints to set up. Raises ConfigurationError for one that is unknown or cannot be set up over CAN."""
    known = configuration.rig.joints
    for joint in [*named, *backups]:
        if joint not in known:
            raise usage_error(f"{joint}: this robot has no such joint; {suggestion(joint, known)}")
    for joint in named:
        if backups and joint not in backups:
            raise ConfigurationError([f"{joint}: the file has {', '.join(backups)}"])
    wanted = named or backups or known
    joints = [joint for joint in known if joint in wanted]
    for joint in joints:
        if configuration.drive[joint].type not in DRIVE_BENCHES:
            problem = f"drive.{joint}.type = {configuration.drive[joint].type!r}: cannot be set up over CAN"
            raise ConfigurationError([f"{problem}; name the other joints"])
    return joints


def _read(
    opened: Sequence[OpenedBus], configuration: Configuration, joints: Sequence[str], documents: Sequence[object]
) -> list[JointSetup]:
    """Read every drive's settings. Raises CommandError where one is not the configured one, or cannot be used."""
    buses = {bus.name: bus for bus in opened}
    with watched() as show:
        problems = [each for bus in opened for each in bus_problems(bus, configuration, joints, show)]
        if problems:
            nothing = "nothing was read or written: correct this first; 'mudskipper drives find' lists all"
            raise CommandError(*problems, nothing)
        setups = [
            read_joint(joint, buses[configuration.drive[joint].bus], configuration, documents, show) for joint in joints
        ]
    if problems := [f"{each.joint}: {each.found.problem}" for each in setups if each.found.problem]:
        raise CommandError(*problems, "nothing was written: correct this first")
    return setups


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
    """Return the old values. Raises CommandError where a file is of another drive, or a value cannot be read."""
    for each in setups:
        backup, found = backups[each.joint], each.found
        if (backup.type, backup.serial_number) != (found.type, found.serial_number):
            text = f"{each.joint}: the file is of a drive of type {backup.type} with serial number"
            raise CommandError(f"{text} {backup.serial_number or '-'}, not {found.serial_number or '-'}")
        for key in backup.old.keys() - each.values.keys():
            raise CommandError(f"{each.joint}: {key}: {each.unreadable.get(key, 'this drive has no such setting')}")
        print(f"{each.joint} had {backup.state(each.values)} until now")
    return {each.joint: backups[each.joint].old for each in setups}


def _write(setups: Sequence[JointSetup], changes: Changes, names: Names) -> int:
    """Write one drive at a time, and stop at the first that does not end with its new settings."""
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
                if any(after.joint in changes for after in setups[done + 1 :]):
                    print("the drives after it were not changed")
                return exit_codes.INTERRUPTED if interrupted() else exit_codes.UNHEALTHY
    return exit_codes.OK


@contextmanager
def deferred_ending() -> Iterator[Callable[[], bool]]:
    """Yield whether a signal asked this program to end. Without this it would end between two settings."""
    asked = []
    before = {number: signal.signal(number, lambda number, frame: asked.append(number)) for number in ENDINGS}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
