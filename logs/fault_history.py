"""The faults of a log, grouped by their causes as the daemon groups those that are present.

The log has a text for each fault that begins or is over. An episode lasts from the first fault to the moment at which
none is present any more; within it, a fault may follow from another. The same cause in several episodes is one entry.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, NamedTuple

from control.fault_causes import AgedFault, Cause, group_by_cause, is_settling
from control.faults import FAULT_KINDS, Fault, FaultKind
from control.records import FLIPPERS, JOINTS

BEGUN = re.compile(r"fault (\w+) \(\w+\): (.*)", re.DOTALL)
OVER = re.compile(r"over: (\w+) ?(.*)")
HEARD = "mode boot to "  # all drives, for the first time


class LoggedCause(NamedTuple):
    first_s: float
    times: int  # in how many episodes, or how often within one
    name: str
    subjects: tuple[str, ...]
    message: str  # of the first time
    what_to_do: str
    consequences: tuple[str, ...]  # names of faults, of all times


class Begun(NamedTuple):
    fault: Fault
    stamp_s: float
    message: str


def read_causes(events: Iterable[Mapping[str, Any]], configuration_text: str) -> list[LoggedCause]:
    """Return the causes of all faults in a log, in the order of their first time."""
    bus_of = read_buses(configuration_text)
    found: dict[tuple[str, tuple[str, ...]], LoggedCause] = {}
    for episode in _episodes(events, set(bus_of.values())):
        for cause in _causes_in(episode, bus_of):
            key = cause.name, cause.subjects
            before = found.get(key)
            found[key] = _joined(before, cause) if before else cause
    return sorted(found.values(), key=lambda cause: cause.first_s)


def read_buses(configuration_text: str) -> dict[str, str]:
    """Return the name of each joint's bus, as far as the configuration names it."""
    try:
        drives = tomllib.loads(configuration_text).get("drive", {})
        return {joint: str(drives[joint]["bus"]) for joint in JOINTS if joint in drives}
    except (tomllib.TOMLDecodeError, AttributeError, TypeError, KeyError):
        return {}


def _episodes(events: Iterable[Mapping[str, Any]], buses: set[str]) -> list[list[Begun]]:
    episodes: list[list[Begun]] = []
    present: set[tuple[str, str]] = set()
    heard_s = -inf
    for event in events:
        if event["text"].startswith(HEARD):
            heard_s = event["stamp_s"]
        begun, over = BEGUN.fullmatch(event["text"]), OVER.fullmatch(event["text"])
        if begun and begun[1] in FAULT_KINDS:
            kind, message = FAULT_KINDS[begun[1]], begun[2]
            fault = kind.fault(_subject(kind, message, buses))
            if not present:
                episodes.append([])
            present.add((fault.name, fault.subject))
            episodes[-1].append(Begun(fault, event["stamp_s"], message))
        elif over and episodes:
            present = {each for each in present if each != (over[1], over[2])}
            ended = [each for each in episodes[-1] if (each.fault.name, each.fault.subject) == (over[1], over[2])]
            if ended and is_settling(ended[-1].fault, event["stamp_s"] - heard_s):
                episodes[-1].remove(ended[-1])  # only logs of version 0.2 and before have these
    return list(filter(None, episodes))


def _subject(kind: FaultKind, message: str, buses: set[str]) -> str:
    """Return the part of the robot that a message is about: every message names it."""
    names: dict[str, Iterable[str]] = {"bus": sorted(buses), "flipper": FLIPPERS, "estimator": FLIPPERS}
    candidates = names.get(kind.part, JOINTS)
    return next((name for name in candidates if re.search(rf"\b{re.escape(name)}\b", message)), "")


def _causes_in(episode: list[Begun], bus_of: Mapping[str, str]) -> list[LoggedCause]:
    end_s = episode[-1].stamp_s
    first = {}
    for begun in reversed(episode):
        first[begun.fault.kind, begun.fault.subject] = begun
    aged = [AgedFault(begun.fault, end_s - begun.stamp_s) for begun in reversed(first.values())]
    return [_logged(cause, episode) for cause in group_by_cause(aged, bus_of)]


def _logged(cause: Cause, episode: list[Begun]) -> LoggedCause:
    own = [each.fault for each in cause.faults]
    roots = [begun for begun in episode if begun.fault in own]
    return LoggedCause(
        first_s=roots[0].stamp_s,
        times=sum(begun.fault == cause.root for begun in roots),
        name=cause.root.name,
        subjects=tuple(sorted(each.fault.subject for each in cause.faults)),
        message=roots[0].message,
        what_to_do=cause.root.kind.what_to_do,
        consequences=tuple(dict.fromkeys(each.fault.name for each in cause.consequences)),
    )


def _joined(before: LoggedCause, again: LoggedCause) -> LoggedCause:
    consequences = dict.fromkeys((*before.consequences, *again.consequences))
    return before._replace(times=before.times + again.times, consequences=tuple(consequences))
