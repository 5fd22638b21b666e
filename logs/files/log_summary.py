"""What `mudskipper log info` prints of a log, and when and in which segment of its run it begins."""

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from math import isfinite
from typing import Any

from firmware_host.trial import BEGUN, METADATA_KEY, OperatorReport, Trial, from_json, read_report
from logs.files.log_reader import AnyLog
from logs.files.tick_array import Ticks

MOST_DIGITS = 20  # of a time in nanoseconds


def log_summary(log: AnyLog) -> dict[str, Any]:
    """At rest the log has fewer rows than ticks ran."""
    ends = log.ends
    duration_s = float(ends["stamp_s"][-1] - ends["stamp_s"][0]) if len(ends) else 0.0
    duration_s = duration_s if isfinite(duration_s) else 0.0
    ticks = _ticks_run(ends)
    return {
        "robot": log.metadata.get("robot", ""),
        "run": log.metadata.get("run_id", ""),
        "segment": segment_of(log) if log.metadata.get("segment") else None,
        "trial": trial_of(log),
        "started": _start_time(log),
        "duration_s": round(duration_s, 3),
        "rate_hz": round((ticks - 1) / duration_s, 2) if duration_s > 0.0 else None,
        "rows": log.rows,
        "ticks": ticks,
        "missed_ticks": int(ends["missed_ticks"][-1]) if len(ends) else 0,
        "strides": len(log.strides),
        "events": len(log.events),
        "complete": log.complete,
        "recovered": log.metadata.get("recovered") == "true",
        "version": log.metadata.get("version", ""),
        "commit": log.metadata.get("commit", ""),
        "unknown_fields": list(log.unknown_fields),
        "missing_fields": list(log.missing_fields),
    }


def _ticks_run(ends: Ticks) -> int:
    """Return the number of ticks from the first row to the last one, without those that were missed."""
    if not len(ends):
        return 0
    first, last = ends[0], ends[-1]
    return int(last["tick"]) - int(first["tick"]) + 1 - (int(last["missed_ticks"]) - int(first["missed_ticks"]))


def segment_of(log: AnyLog) -> int:
    """Return the number of the first segment in the run; 0 where none is given."""
    number = log.metadata.get("segment", "")
    return int(number) if number.isdecimal() else 0


def trial_of(log: AnyLog) -> Trial:
    """Return the description of the log's trial; empty where it has none."""
    return from_json(log.metadata.get(METADATA_KEY, ""))


def segments_before(log: AnyLog) -> int:
    """Return how many segments of the run may have rows of the log's first walk: none where it begins with a trial."""
    first = read_report(log.events[0]["text"]) if log.events else None
    return 0 if first and first.kind == BEGUN else segment_of(log)


def operator_reports(events: Iterable[Any]) -> list[tuple[float, OperatorReport]]:
    """Return the trials, notes and markers among the events, each after its time by the log's own clock."""
    found = ((float(event["stamp_s"]), read_report(str(event["text"]))) for event in events)
    return [(stamp_s, report) for stamp_s, report in found if report]


def wall_offset_ns(metadata: Mapping[str, str]) -> int | None:
    """Return the wall clock minus the log's own clock when the log began; None where the log does not know it."""
    text = metadata.get("wall_minus_monotonic_ns", "")
    return int(text) if text.isdecimal() and len(text) < MOST_DIGITS else None


def begin_s(log: AnyLog) -> float:
    """Return the time of the first row by the log's own clock; 0 where there is none."""
    stamps_s = [*log.ends["stamp_s"][:1], *(row["stamp_s"] for row in (*log.strides[:1], *log.events[:1]))]
    return float(min(stamps_s, default=0.0))


def _start_time(log: AnyLog) -> str:
    """Return the universal time of the first row, to the second; empty where it is not known."""
    if not (log.rows or log.strides or log.events) or "wall_minus_monotonic_ns" not in log.metadata:
        return ""
    try:
        wall_s = begin_s(log) + int(log.metadata["wall_minus_monotonic_ns"]) / 1e9
        return datetime.fromtimestamp(wall_s, UTC).isoformat(timespec="seconds")
    except (ValueError, OverflowError, OSError):  # beyond what a date can be
        return ""
