"""The logs in folders, and the group of repetitions that each belongs to.

A group is a mud: the one that a log of this project names, or the label in the name of a file of the paper's authors,
`12.5N` of `single_12.5N_trial1.csv.gz`; a pattern for the names of files replaces both. The muds of walks are
groups of their own, `walk 15.6N`, because a walking robot does not repeat a stroke.
"""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from filecmp import cmp
from fnmatch import fnmatchcase
from math import inf
from pathlib import Path
from typing import NamedTuple

from experiments.reports.mud_names import mud_key
from experiments.study.option import OptionError
from firmware_host.log.log_folder import SEGMENT, age_of
from firmware_host.trial import Trial
from logs.files.log_error import LogError
from logs.files.log_summary import trial_of
from logs.files.scanned_log import scan_log
from logs.files.whole_files import is_hidden
from logs.lab.csv_table import unpack
from logs.lab.lab_csv import is_lab_csv, log_name

ENDINGS = (".csv", ".csv.gz", ".mcap")
LABEL = re.compile(r"(?<![0-9.])(\d+(?:\.\d+)?N)(?![A-Za-z0-9])")
KIND = re.compile(r"(?:^|[^A-Za-z])(single|walk)(?:ing)?(?![A-Za-z])", re.IGNORECASE)
Paths = tuple[Path, ...]


class GroupRule(NamedTuple):
    """Logs whose file name matches the pattern, as in a shell, belong to the group."""

    pattern: str
    name: str


def parse_rule(text: str) -> GroupRule:
    """Parse PATTERN=NAME. Raises OptionError."""
    pattern, _, name = text.rpartition("=")
    if not (pattern and name):
        raise OptionError(f"{text}: must be a pattern and a name, such as 'single_12.5N*=soft'")
    return GroupRule(pattern, name)


def find_logs(folders: Sequence[Path]) -> list[Paths]:
    """Return the logs in folders and the folders below them; segments of one run are one log. Also accepts files.

    A copy under the same name, such as one in a report's folder or an unpacked one, is left out: it repeats nothing.
    """
    found: dict[Path, Path] = {}
    for folder in folders:
        below = [each for each in sorted(folder.rglob("*")) if not is_hidden(each, folder)]
        files = below if folder.is_dir() else [folder]
        found |= {path.resolve(): path for path in files if path.is_file() and path.name.endswith(ENDINGS)}
    paths: list[Path] = []
    for path in sorted(found.values(), key=lambda each: len(each.parts)):  # of two copies the one higher up stays
        if not any(_is_copy(path, other) for other in paths):
            paths.append(path)
    first: dict[Path, Path] = {}
    for path in sorted(paths, key=age_of):
        before = _segment_before(path)
        first[path] = first[before] if before in first and _trial_in(before) == _trial_in(path) else path
    runs: dict[Path, list[Path]] = {}
    for path in paths:
        runs.setdefault(first[path], []).append(path)
    return [tuple(sorted(run)) for run in runs.values()]


def _is_copy(path: Path, other: Path) -> bool:
    """Return whether files of one name have the same contents; of a CSV one may be compressed."""
    if path.name == other.name:
        return cmp(path, other, shallow=False)
    if log_name(path) != log_name(other) or not (is_lab_csv(path) and is_lab_csv(other)):
        return False
    try:
        return unpack(path) == unpack(other)
    except LogError:
        return False  # the reader says what is wrong with it


def _segment_before(path: Path) -> Path | None:
    """Return the path that the segment before this one has if both are of one trial."""
    segment = SEGMENT.fullmatch(path.stem)
    if segment is None or int(segment["number"]) == 0:
        return None
    trial = segment["trial"] or ""
    return path.with_name(f"{segment['run']}-{int(segment['number']) - 1:04d}{trial}{path.suffix}")


def _trial_in(path: Path) -> Trial:
    """Return the description in a log, of which its name has a part alone: none of "泥" and of a note."""
    with suppress(LogError):
        return trial_of(scan_log(path, from_s=inf))
    return {}


def matches(name: str, pattern: str) -> bool:
    """Match a file name with its ending or without it."""
    stem = next((name.removesuffix(ending) for ending in (".csv.gz", *ENDINGS) if name.endswith(ending)), name)
    return fnmatchcase(name, pattern) or fnmatchcase(stem, pattern)


def groups_of(logs: Iterable[tuple[str, str]], rules: Sequence[GroupRule]) -> list[str | None]:
    """Return the group of each log by its file name and its own mud, as the first log spells that."""
    spelled: dict[str, str] = {}
    return [group_of(name, rules, spelled.setdefault(mud_key(mud), mud)) for name, mud in logs]


def group_of(name: str, rules: Sequence[GroupRule], mud: str = "") -> str | None:
    """Return the group of the first rule that matches, else the log's own mud, or the label in the name, else None."""
    ruled = next((rule.name for rule in rules if matches(name, rule.pattern)), None)
    return ruled or mud or _labelled_group(name)


def _labelled_group(name: str) -> str | None:
    label = LABEL.search(name)
    if label is None:
        return None
    kind = KIND.search(name[: label.start(1)])
    return f"walk {label[1]}" if kind and kind[1].lower() == "walk" else label[1]


def group_key(group: str) -> tuple[bool, bool, float, str]:
    """Return a key that sorts groups: labels before names, single flippers before walks, stronger mud first."""
    label = re.fullmatch(r"(walk )?(\d+(?:\.\d+)?)N", group)
    return label is None, bool(label and label[1]), -float(label[2]) if label else 0.0, group
