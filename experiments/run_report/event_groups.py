"""Events that differ only in their numbers as one group: 200 overruns are one row of a report."""

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from logs.fault_history import BEGUN, OVER

NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w])")


class EventGroup(NamedTuple):
    first_s: float
    last_s: float
    times: int
    text: str  # with the range of each number that differs


def group_events(events: Iterable[Mapping[str, Any]]) -> list[EventGroup]:
    """Group all events except faults, which are grouped by their causes, in the order of their first time."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for event in events:
        if not (BEGUN.fullmatch(event["text"]) or OVER.fullmatch(event["text"])):
            groups.setdefault(NUMBER.sub("#", event["text"]), []).append(event)
    return [
        EventGroup(group[0]["stamp_s"], group[-1]["stamp_s"], len(group), _common_text(group))
        for group in groups.values()
    ]


def _common_text(group: list[Mapping[str, Any]]) -> str:
    columns = zip(*(NUMBER.findall(event["text"]) for event in group), strict=True)
    ranges = iter([_range_text(numbers) for numbers in columns])
    return NUMBER.sub(lambda _: next(ranges), group[0]["text"])


def _range_text(numbers: tuple[str, ...]) -> str:
    low, high = min(numbers, key=float), max(numbers, key=float)
    return low if low == high else f"{low} to {high}"
