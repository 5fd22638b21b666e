"""What a walk was for: its mud, number, operator and more, as names and texts that an operator gives.

The loop's process keeps the description and reports each change as an event. The log's writer acts on these events:
with a trial it begins a new file, which has the description in its name and metadata, and it stores the defaults in the
log folder, where the next start of the daemon reads them. So the loop waits for no file. Notes and markers are events
of the same form. Each text has the wall clock at its moment, and its row the monotonic one.
"""

import json
import os
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

Trial = dict[str, str]

KEYS = {
    "mud": "name of the mud",
    "water": "water content of the mud in %",
    "trial": "number or name of the trial",
    "operator": "who operates the robot",
    "tags": "words, separated by commas",
    "note": "free text",
}
KEY = re.compile(r"[a-z][a-z0-9_]{0,31}")
LONGEST_VALUE = 900  # characters: as an event, with four bytes for each, it goes through a pipe at once
LONGEST_TRIAL = 3000  # bytes, for the same reason
MOST_WATER = 100.0  # %
NAMED = ("mud", "trial")  # in the name of a file
LONGEST_NAME = 40  # of each of them there
DEFAULTS = "trial.json"  # in the log folder
METADATA_KEY = "trial"  # in a log's metadata: JSON

BEGUN, SET, NOTE, MARKER = "trial", "trial set", "note", "marker"
REPORT = re.compile(rf"({SET}|{BEGUN}|{NOTE}|{MARKER}) at (\S+) by ([^:]*): (.*)", re.DOTALL)


class OperatorReport(NamedTuple):
    """An event that an operator caused: a trial, new defaults, a note or a marker."""

    kind: str
    time: datetime  # by the wall clock
    by: str
    text: str  # JSON of a trial and of defaults

    @property
    def event(self) -> str:
        """Return the text in the log."""
        return f"{self.kind} at {self.time.isoformat(timespec='microseconds')} by {self.by}: {self.text}"


def read_report(event: str) -> OperatorReport | None:
    """Return the report in the text of an event; None for every other event."""
    found = REPORT.fullmatch(event)
    if found is None:
        return None
    try:
        return OperatorReport(found[1], datetime.fromisoformat(found[2]).astimezone(UTC), found[3], found[4])
    except ValueError:
        return None


def changed(trial: Mapping[str, str], changes: Mapping[str, str]) -> Trial:
    """Return the trial with these keys; an empty value removes one. Raises ValueError with one sentence."""
    for key, value in changes.items():
        if not KEY.fullmatch(key):
            raise ValueError(f"{key!r:.40} is no key: must be 1 to 32 lower-case letters, digits or _, a letter first")
        if len(value) > LONGEST_VALUE or not value.isprintable():
            raise ValueError(f"{key} = {value!r:.40}: must be at most {LONGEST_VALUE} printable characters")
        if key == "water" and value and not _is_water(value):
            raise ValueError(f"water = {value!r:.40}: must be a number from 0 to {MOST_WATER:g} %")
    after = {key: value for key, value in (dict(trial) | dict(changes)).items() if value}
    if (length := len(to_json(after).encode())) > LONGEST_TRIAL:
        raise ValueError(f"the trial has {length} bytes: must be at most {LONGEST_TRIAL}, so shorten its note")
    return after


def _is_water(text: str) -> bool:
    try:
        return 0.0 <= float(text) <= MOST_WATER
    except ValueError:
        return False


def to_json(trial: Mapping[str, str]) -> str:
    return json.dumps(trial, ensure_ascii=False)


def from_json(text: str) -> Trial:
    """Return the trial in a text of another program; empty where it has none."""
    try:
        return changed({}, json.loads(text))
    except (ValueError, TypeError, AttributeError, RecursionError):
        return {}


def name_part(trial: Mapping[str, str]) -> str:
    """Return what a file's name has of a trial, such as _A_3; a mud that is named like a path is no path there."""
    parts = [re.sub(r"[^A-Za-z0-9_.]+", "_", trial.get(key, "")).strip("_.")[:LONGEST_NAME] for key in NAMED]
    return "".join(f"_{part}" for part in parts if part)


def load_defaults(folder: Path) -> Trial:
    """Return the defaults that an earlier run stored; none where they are missing or damaged."""
    try:
        return from_json((folder / DEFAULTS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def store_defaults(folder: Path, text: str) -> None:
    """Store the defaults, which are JSON, all or nothing. Raises OSError."""
    hidden = folder / f".{DEFAULTS}"
    with hidden.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    hidden.replace(folder / DEFAULTS)
