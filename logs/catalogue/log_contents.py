"""Reads a log for the catalogue: walks, strides, muds, speeds and faults."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from math import fsum, inf, isfinite
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from control.modes import Mode
from control.records import COEFFICIENTS
from firmware_host.log.log_file import EXPORTED
from firmware_host.trial import KEYS, Trial, to_json
from logs.catalogue.entry import FileStamp, LogEntry, MudEntry
from logs.files.log_error import ADVICE, LogError
from logs.files.log_reader import Log, read_log
from logs.files.log_summary import log_summary, segment_of
from logs.files.tick_array import Ticks

ANOTHER_MUD = "another mud"  # the loop's event after a stride that did not fit what was known
FAULT = re.compile(r"fault (\w+) \((?!none\))\w+\)")  # a reaction of none only blocks arming
FIELDS = ("tick", "missed_ticks", "mode", "stamp_s", "body_x_m")  # of a tick, as far as an entry needs them
Rows = Sequence[dict[str, Any]]


def read_entry(path: Path, file: str, stamp: FileStamp) -> LogEntry:
    """Never raises LogError: a log that cannot be read is an entry with the reason."""
    entry = LogEntry(file=file, state="whole", reason="", bytes=stamp.bytes, changed_ns=stamp.changed_ns)
    try:
        log = read_log(path, fields=FIELDS)
    except LogError as problem:
        return entry._replace(state="broken", reason=str(problem).removeprefix(f"{path}: "))
    if not (log.metadata or len(log.ticks) or log.strides or log.events):
        return entry._replace(state="no log", reason="mudskipper did not write this file")
    if EXPORTED in log.metadata:
        return entry._replace(state="export", reason="'mudskipper log export' made this copy")
    if not log.complete:
        entry = entry._replace(state="broken", reason=f"its end is missing; {ADVICE}")
    return entry_of_log(entry, log)


def entry_of_log(entry: LogEntry, log: Log) -> LogEntry:
    """Return the entry with what the log contains."""
    summary = log_summary(log)
    walks = _walks(log.ticks)
    distance_m, speed_m_s = _travel(walks)
    return entry._replace(
        run=str(summary["run"]),
        segment=segment_of(log),
        robot=str(summary["robot"]),
        **_description(summary["trial"]),
        started=_utc(str(summary["started"])),
        duration_s=float(summary["duration_s"]),
        walks=len(walks),
        strides=len(log.strides),
        stuck_strides=sum(not stride["released"] for stride in log.strides),
        distance_m=distance_m,
        speed_m_s=speed_m_s,
        muds=tuple(_muds(log, walks)),
        faults=tuple(sorted({found[1] for event in log.events if (found := FAULT.match(event["text"]))})),
        recovered=bool(summary["recovered"]),
        configuration_sha256=log.metadata.get("configuration_sha256", ""),
        version=str(summary["version"]),
        commit=str(summary["commit"]),
    )


def _description(trial: Trial) -> dict[str, Any]:
    """Return the columns of a trial; `tags` become a list, and keys without a column JSON."""
    columns = {key: trial.get(key, "") for key in ("mud", "trial", "operator", "note")}
    water, tags = trial.get("water"), filter(None, trial.get("tags", "").split(","))
    return columns | {
        "water": float(water) if water else None,
        "tags": tuple(tag.strip() for tag in tags),
        "more": to_json({key: value for key, value in trial.items() if key not in KEYS}),
    }


def _utc(text: str) -> datetime | None:
    return datetime.fromisoformat(text).astimezone(UTC).replace(tzinfo=None) if text else None


def _walks(ticks: Ticks) -> list[Ticks]:
    """Return the ticks of each walk, from its beginning until the robot no longer walks."""
    walking = ticks["mode"] == Mode.WALKING
    edges = np.flatnonzero(np.diff(np.concatenate([[False], walking, [False]]).astype(np.int8)))
    return [ticks[begin:end] for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def _travel(walks: Sequence[Ticks]) -> tuple[float | None, float | None]:
    """Return distance and mean speed of these walks; None without a pose. Between two walks the robot may be moved."""
    known = [walk[np.isfinite(walk["body_x_m"])] for walk in walks]
    spans = [walk[[0, -1]] for walk in known if len(walk)]
    distance_m = fsum(float(np.diff(span["body_x_m"])[0]) for span in spans)
    duration_s = fsum(float(np.diff(span["stamp_s"])[0]) for span in spans)
    return (distance_m, distance_m / duration_s) if duration_s > 0.0 else (None, None)


def _muds(log: Log, walks: Sequence[Ticks]) -> list[MudEntry]:
    """Each walk begins another mud: the robot has forgotten the one before, and may have been moved."""
    starts_s = [float(walk["stamp_s"][0]) for walk in walks[1:]]
    return [mud for span_s in pairwise([-inf, *starts_s, inf]) for mud in _muds_between(log, walks, *span_s)]


def _muds_between(log: Log, walks: Sequence[Ticks], from_s: float, to_s: float) -> list[MudEntry]:
    found_s = [event["stamp_s"] for event in log.events if event["text"].startswith(ANOTHER_MUD)]
    borders_s = [from_s, *(stamp_s for stamp_s in found_s if from_s < stamp_s < to_s), to_s]
    groups = [
        [stride for stride in log.strides if begin_s <= stride["stamp_s"] < end_s]
        for begin_s, end_s in pairwise(borders_s)
    ]
    muds: list[Rows] = [*filter(None, groups), []]
    return [_mud(strides, following, walks) for strides, following in pairwise(muds)]


def _mud(strides: Rows, following: Rows, walks: Sequence[Ticks]) -> MudEntry:
    """A stride lasts from its insertion to the next one; the last of a walk has no duration."""
    starts_s, ends_s = ([stride["t_start_s"] for stride in rows] for rows in (strides, following))
    begin_s, end_s = min(starts_s), min(ends_s, default=max(starts_s))
    there = [walk[(walk["stamp_s"] >= begin_s) & (walk["stamp_s"] <= end_s)] for walk in walks]
    medians = {name: _median(strides, name) for name in COEFFICIENTS}
    return MudEntry(strides=len(strides), speed_m_s=_travel(there)[1], **medians)


def _median(strides: Rows, name: str) -> float | None:
    """Return the median of the valid values that are no bounds."""
    usable = [stride[name] for stride in strides if stride[f"{name}_valid"] and not stride[f"{name}_at_least"]]
    return median(finite) if (finite := [float(value) for value in usable if isfinite(value)]) else None
