"""Writes settings to one drive so that it ends with all the old or all the new ones, and says which.

Settings go to the drive's memory first and are read back one by one. Only when all are right are they stored, by one
command. Until then an interruption, a lost cable or a setting that reads back otherwise makes the old values be written
again; a drive that does not answer has stored nothing, so it has the old ones after its supply was switched off and
on. The storing itself is never interrupted by this program. Where the drive falls silent in it, only the drive knows.
"""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import NamedTuple

from drivers.bench.bench_port import NoAnswerError
from drivers.bench.drive_setup import CannotReadError, DriveSetup, same


class Outcome(StrEnum):
    NEW = "new"
    OLD = "old"
    OLD_AFTER_RESTART = "old after a restart"
    UNKNOWN = "unknown"


class Change(NamedTuple):
    outcome: Outcome
    text: str  # for people


class NotTakenError(Exception):
    """A drive has another value than was written, or the user interrupted the writing."""


NOT_STORED = "nothing was stored, so it has the {} settings once its supply was switched off and on"
PROBLEMS = (NoAnswerError, CannotReadError, NotTakenError)


class Names(NamedTuple):
    """The words for the two settings in texts for people."""

    before: str = "old"
    after: str = "new"


def change_settings(
    drive: DriveSetup,
    old: Mapping[str, float],
    new: Mapping[str, float],
    interrupted: Callable[[], bool],
    names: Names,
) -> Change:
    """Write and store `new`; `old` are the values of the same keys before. A drive that is not idle is left alone."""
    try:
        if activity := drive.activity():
            return Change(Outcome.OLD, f"it is not idle ({activity}): nothing was written")
        for key, value in new.items():
            _require_not(interrupted())
            drive.write(key, value)
            _require(drive, key, value)
        for key, value in new.items():  # a restart in between would have lost the first ones
            _require(drive, key, value)
        _require_not(interrupted())
        activity = drive.activity()
    except PROBLEMS as problem:
        return _put_back(drive, old, str(problem), names)
    if activity:
        text = f"it is not idle any more ({activity}): {NOT_STORED.format(names.before)}"
        return Change(Outcome.OLD_AFTER_RESTART, text)
    return _store(drive, old, new, names)


def _store(drive: DriveSetup, old: Mapping[str, float], new: Mapping[str, float], names: Names) -> Change:
    try:
        drive.save()
        found = {key: drive.read(key) for key in new}
    except PROBLEMS as problem:
        either = f"it has either the {names.before} or the {names.after} settings; 'drives setup' shows which"
        return Change(Outcome.UNKNOWN, f"{problem}, while it stored its settings: {either}")
    for outcome, name, expected in ((Outcome.NEW, names.after, new), (Outcome.OLD, names.before, old)):
        if all(same(found[key], value) for key, value in expected.items()):
            return Change(outcome, f"it has the {name} settings; {drive.stored}")
    differing = ", ".join(f"{key} = {found[key]:g}" for key, value in new.items() if not same(found[key], value))
    return Change(Outcome.UNKNOWN, f"it reads back other settings than it was to store: {differing}")


def _put_back(drive: DriveSetup, old: Mapping[str, float], reason: str, names: Names) -> Change:
    try:
        for key, value in old.items():
            drive.write(key, value)
            _require(drive, key, value)
    except PROBLEMS as problem:
        text = f"{reason}; then {problem}" if str(problem) != reason else reason
        return Change(Outcome.OLD_AFTER_RESTART, f"{text}: {NOT_STORED.format(names.before)}")
    return Change(Outcome.OLD, f"{reason}: it has the {names.before} settings, nothing was stored")


def _require_not(interrupted: bool) -> None:
    if interrupted:
        raise NotTakenError("interrupted")


def _require(drive: DriveSetup, key: str, value: float) -> None:
    found = drive.read(key)
    if not same(found, value):
        raise NotTakenError(f"{key} reads back as {found:g} after {value:g} was written")
