"""A log of any length: one pass finds everything but its ticks, and each later pass reads the ticks in blocks.

The first pass, the scan, refuses a damaged log before anything is made of it, and finds the few rows that readers need
before the first tick: strides, events, the first and the last tick. Readers then consume blocks of some thousand ticks,
so the memory that they need hardly depends on the length of the log.
"""

from collections.abc import Iterator, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from control.records import Rig
from firmware_host.log.rows import EVENT_KIND, STRIDE_KIND, rig_of
from firmware_host.trial import METADATA_KEY
from logs.files.file_pass import EVERYTHING, FilePass, Spans
from logs.files.log_error import LogError, Watch, unwatched
from logs.files.tick_array import BLOCK_ROWS, Ticks, TickTally, divide_ticks, in_groups, in_order


class ScannedFile(NamedTuple):
    """A file as the scan found it: later passes end where that one did."""

    path: Path
    size: int
    rows: int

    def ticks(self, watch: Watch, spans: Spans) -> Iterator[Ticks]:
        """Raises LogError, also where ticks that the scan read are no longer there."""
        file_pass = FilePass(self.path, self.size, spans)
        yield from _divided_ticks(file_pass, watch)
        if file_pass.size != self.size:
            raise LogError(f"{self.path}: was cut off while it was read: read it again")


def _divided_ticks(file_pass: FilePass, watch: Watch) -> Iterator[Ticks]:
    for stored in in_groups(file_pass.ticks(watch), BLOCK_ROWS):
        yield divide_ticks(file_pass.tick_kind, stored)


class ScannedLog(NamedTuple):
    """One log, or the joined segments of one run."""

    metadata: dict[str, str]
    configuration_text: str
    strides: list[dict[str, Any]]
    events: list[dict[str, Any]]
    complete: bool  # False where the writer was cut off; everything before that is here
    unknown_fields: tuple[str, ...]  # such as "/tick battery_v", which this version does not know
    missing_fields: tuple[str, ...]  # which the version that wrote the log did not know
    rig: Rig  # whose joints and flippers the arrays of a tick have, in its order
    tick_type: np.dtype[np.void]
    tally: TickTally
    files: tuple[ScannedFile, ...]
    spans: Spans

    @property
    def rows(self) -> int:
        return self.tally.rows

    @property
    def ends(self) -> Ticks:
        """The first and the last tick; empty where there is none."""
        return np.empty(0, self.tick_type) if self.tally.ends is None else self.tally.ends

    def blocks(self, watch: Watch = unwatched, spans: Spans = ()) -> Iterator[Ticks]:
        """Yield the ticks in the order of their numbers. With spans, most ticks outside of them are left out.

        Raises LogError, also where a file was cut off since the scan.
        """
        ticks = (block for file in self.files for block in file.ticks(watch, spans or self.spans))
        yield from in_order(ticks, self.tally.farthest)


def scan_log(path: Path, watch: Watch = unwatched, from_s: float = -inf) -> ScannedLog:
    """Scan one file; of the rows before `from_s` it reads only the first chunk. Raises LogError."""
    spans = EVERYTHING if from_s == -inf else ((from_s, inf),)
    found, tally = FilePass(path, spans=spans), TickTally()
    for ticks in _divided_ticks(found, watch):
        tally.add(ticks)
    found.require_all_rows()
    kind = found.tick_kind
    return ScannedLog(
        metadata=found.metadata,
        configuration_text=found.configuration_text,
        strides=found.decoded(STRIDE_KIND),
        events=found.decoded(EVENT_KIND),
        complete=found.complete,
        unknown_fields=found.unknown_fields(),
        missing_fields=found.missing_fields(),
        rig=rig_of(kind.metadata),
        tick_type=divide_ticks(kind, np.empty(0, f"V{kind.layout.size}")).dtype,
        tally=tally,
        files=(ScannedFile(path, found.size or 0, tally.rows),),
        spans=spans,
    )


def scan_logs(paths: Sequence[Path], watch: Watch = unwatched, from_s: float = -inf) -> ScannedLog:
    """Scan one log, or several segments of one run. Raises LogError, also where a segment between is missing."""
    return join_logs(paths, [scan_log(path, watch, from_s) for path in paths])


def join_logs(paths: Sequence[Path], logs: Sequence[ScannedLog]) -> ScannedLog:
    """Join the logs of several segments of one run; a single log stays as it is. Raises LogError."""
    if len(logs) == 1:
        return logs[0]
    if len({log.metadata.get("run_id") for log in logs}) > 1 or "run_id" not in logs[0].metadata:
        raise LogError(f"{paths[0]}: not of one run with the others; read each alone")
    try:
        by_number = {int(log.metadata["segment"]): log for log in logs}
    except (KeyError, ValueError):
        raise LogError(f"{paths[0]}: the segments of its run are not numbered; read each alone") from None
    numbers = sorted(int(log.metadata["segment"]) for log in logs)
    if numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        raise LogError(f"{paths[0]}: {_why_not_joined(numbers)}")
    ordered = [by_number[number] for number in numbers]
    if any(log.tick_type != ordered[0].tick_type for log in ordered):
        raise LogError(f"{paths[0]}: the segments of its run have different fields; read each alone")
    tally = TickTally()
    for log in ordered:
        tally.add_after(log.tally)
    metadata = dict(ordered[0].metadata)
    if len({log.metadata.get(METADATA_KEY) for log in ordered} - {None}) > 1:  # a rest after a trial has none
        metadata.pop(METADATA_KEY, None)
    if any(log.metadata.get("recovered") == "true" for log in ordered):
        metadata["recovered"] = "true"
    return ordered[0]._replace(
        metadata=metadata,
        strides=[stride for log in ordered for stride in log.strides],
        events=[event for log in ordered for event in log.events],
        complete=all(log.complete for log in ordered),
        tally=tally,
        files=tuple(file for log in ordered for file in log.files),
    )


def _why_not_joined(numbers: list[int]) -> str:
    missing = sorted(set(range(numbers[0], numbers[-1])) - set(numbers))
    twice = sorted({number for number in numbers if numbers.count(number) > 1})
    wrong = [f"{', '.join(map(str, missing[:20]))} missing"] * bool(missing)
    wrong += [f"{', '.join(map(str, twice[:20]))} given twice"] * bool(twice)
    return f"segments {numbers[0]} to {numbers[-1]} of its run are not all here, each once: {'; '.join(wrong)}"
