"""One walk from a log, for the pictures: the time series and the strides of both flippers, one of which is shown first.

A log of the daemon has all of it, for every walk of its run. The authors' CSV has angles, currents and the position of
the body; forces and strides are estimated from them, as in `mudskipper replay`. Values that a log does not have are NaN
and are listed in `missing`.
"""

from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.geometry import FlipperGeometry
from control.records import FLIPPERS, FlipperLoad, Rig
from experiments.pictures.walk_trace import Rows, WalkTraces, drawn_rows
from firmware_host.configuration.configuration import CaptureAxis, Configuration
from firmware_host.log.rows import STRIDE, stride_row
from logs.files.log_error import LogError, Watch, unwatched
from logs.files.log_reader import AnyLog, watched_blocks
from logs.files.log_summary import begin_s, log_summary, segments_before
from logs.files.scanned_log import scan_logs
from logs.lab.body_track import VERTICAL_AXIS
from logs.lab.findings import Finding
from logs.lab.lab_csv import LabLog, is_lab_csv, read_lab_csv
from logs.replay import configuration_of, lab_estimator, lab_readings

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

ANOTHER_MUD = "another mud"  # the loop's event after a stride that did not fit what was known
LOAD_COLUMNS = ("depth_m", "force_x_n", "force_z_n")  # of each flipper
DESCRIPTIONS = {
    "body_x_m": "the position of the body, so no steps",
    "depth_command_m": "the commanded depth",
    "force_z_n": "forces",
}


class TraceSource(NamedTuple):
    """Where the rows are that a trace lacks."""

    log: AnyLog
    rows: Rows  # of the trace
    start_s: float  # of the walk, by the log's own clock


class RecordedWalk(NamedTuple):
    """Times are seconds since the walk began. Arrays have a value a row; those of joints belong to `flipper`.

    A long walk has those rows that a picture of the whole needs (walk_trace.py); `in_detail` reads others.
    """

    title: str
    geometry: FlipperGeometry
    flipper: str
    time_s: Floats
    phase: NDArray[np.int64]  # commanded
    sweep_angle_rad: Floats
    adduction_angle_rad: Floats
    depth_m: Floats  # measured, below the nominal surface
    depth_command_m: Floats
    force_x_n: Floats
    force_z_n: Floats
    body_x_m: Floats
    strides: list[dict[str, Any]]  # rows of log_rows.STRIDE, of both flippers
    noticed_s: list[float]  # when the robot noticed another mud
    walks: int = 1  # in the log
    begun_s: float = 0.0  # since the beginning of the log
    complete: bool = True  # False if the writer of the log was interrupted, or still writes
    cut: str = ""  # how the walk may extend beyond this log
    findings: tuple[Finding, ...] = ()  # what the reader noticed in a CSV of the authors
    series: Mapping[str, Mapping[str, Any]] = {}  # of every flipper that moved, the left one first
    fixed_base: bool = False  # the body cannot advance
    source: TraceSource | None = None  # of a walk that has not every row of the log

    @property
    def sides(self) -> list["RecordedWalk"]:
        """The same walk with each flipper as the one that is shown."""
        return [self._replace(flipper=flipper, **series) for flipper, series in self.series.items()] or [self]

    @property
    def own_strides(self) -> list[dict[str, Any]]:
        """The strides of `flipper`."""
        return [stride for stride in self.strides if FLIPPERS[stride["flipper"]] == self.flipper]

    @property
    def mud_starts_s(self) -> list[float]:
        """The start of each mud after the first: the start of the stride in which the robot noticed it."""
        begun_s = [(stride["stamp_s"], stride["t_start_s"]) for stride in self.own_strides]
        return [max((start for close, start in begun_s if close <= now), default=now) for now in self.noticed_s]

    @property
    def missing(self) -> list[str]:
        """Descriptions of the values that the log does not have."""
        return [text for name, text in DESCRIPTIONS.items() if not np.any(np.isfinite(getattr(self, name)))]


def read_walk(
    path: Path,
    number: int = 0,
    more: Sequence[Path] = (),
    watch: Watch = unwatched,
    vertical: CaptureAxis = VERTICAL_AXIS,
) -> RecordedWalk:
    """Read walk `number` of a log from 1; 0 is the last one. Raises LogError.

    `more` are segments of the same run; `vertical` is the axis of a CSV's capture that points up.
    """
    if not more and is_lab_csv(path):
        return walk_of_lab(path, read_lab_csv(path, vertical), number)
    if not more and path.suffix != ".mcap":
        raise LogError(f"{path}: not a log: its name must end with .mcap, .csv or .csv.gz")
    return numbered_walk(path, scan_logs([path, *more], watch), number, watch)


def numbered_walk(path: Path, log: AnyLog, number: int = 0, watch: Watch = unwatched) -> RecordedWalk:
    """Return a walk of a log; `path` is for messages. Raises LogError."""
    configuration, traces = configuration_of(path, log.configuration_text), WalkTraces(log.rows, number)
    for ticks in watched_blocks(log, watch, "ticks read"):
        traces.add(ticks)
    _refuse_number(path, number, len(traces.walks))
    return walk_of_trace(log, configuration, traces, number or len(traces.walks))


def walk_of_trace(log: AnyLog, configuration: Configuration, traces: WalkTraces, number: int) -> RecordedWalk:
    """Return walk `number` of a log from its trace. Strides and events belong to it up to the next walk."""
    summary, trace, later = log_summary(log), traces.walks[number - 1], traces.walks[number:]
    until_s = later[0].start_s if later else np.inf
    strides = [stride for stride in log.strides if trace.start_s <= stride["stamp_s"] < until_s]
    events = [event for event in log.events if trace.start_s <= event["stamp_s"] < until_s]
    return RecordedWalk(
        title=f"{summary['robot']}  {summary['started']}",
        geometry=configuration.geometry,
        **_columns_of(trace.rows, trace.start_s, log.rig, log.rig.flippers[-1]),
        strides=[_since(trace.start_s, stride) for stride in strides],
        noticed_s=[event["stamp_s"] - trace.start_s for event in events if event["text"] == ANOTHER_MUD],
        walks=len(traces.walks),
        begun_s=trace.start_s - begin_s(log),
        complete=log.complete,
        fixed_base=configuration.estimation.fixed_base,
        cut=_cut_of(log, trace.first_row == 0, trace.end_row == log.rows),
        source=TraceSource(log, trace.rows, trace.start_s) if traces.bin_ticks else None,
    )


def _columns_of(rows: Rows, start_s: float, rig: Rig, flipper: str) -> dict[str, Any]:
    """Return the arrays of a walk in which `flipper` is shown."""
    series: dict[str, dict[str, Any]] = {
        name: {
            "sweep_angle_rad": rows["angle_rad"][:, 2 * number],
            "adduction_angle_rad": rows["angle_rad"][:, 2 * number + 1],
            **{column: rows[column][:, number] for column in LOAD_COLUMNS},
        }
        for number, name in enumerate(rig.flippers)
    }
    return {
        "flipper": flipper,
        **series[flipper],
        "time_s": rows["stamp_s"] - start_s,
        "phase": rows["phase"].astype(np.int64),
        "depth_command_m": rows["depth_command_m"],
        "body_x_m": rows["body_x_m"],
        "series": series,
    }


def in_detail(walk: RecordedWalk, spans_s: Sequence[tuple[float, float]]) -> RecordedWalk:
    """Return the walk with every row between some times, of which a long walk has only a part. Raises LogError."""
    if walk.source is None:
        return walk
    log, rows, start_s = walk.source
    spans = [(start_s + from_s, start_s + to_s) for from_s, to_s in spans_s]
    parts = [rows]
    for ticks in log.blocks(spans=spans):
        stamps_s, inside = ticks["stamp_s"], np.zeros(len(ticks), dtype=np.bool_)
        for from_s, to_s in spans:
            inside |= (stamps_s >= from_s) & (stamps_s <= to_s)
        parts.append(drawn_rows(ticks[inside]))
    joined = np.concatenate(parts)
    detailed = joined[np.unique(joined["tick"], return_index=True)[1]]
    return walk._replace(**_columns_of(detailed, start_s, log.rig, walk.flipper))


def _cut_of(log: AnyLog, from_the_first: bool, to_the_last: bool) -> str:
    """Describe how the walk may extend beyond this segment of its run."""
    number = segments_before(log)
    before = [f"begun before segment {number}"] * (from_the_first and number > 0)
    after = ["continued in the next segment"] * (to_the_last and log.complete and "segment" in log.metadata)
    return " and ".join(before + after)


def _refuse_number(path: Path, number: int, walks: int) -> None:
    if not walks:
        raise LogError(f"{path}: there is no walk in this log")
    if number > walks:
        raise LogError(f"{path}: it has no walk {number}, only {walks}")


def _since(start_s: float, stride: dict[str, Any]) -> dict[str, Any]:
    return stride | {name: stride[name] - start_s for name in ("stamp_s", "t_start_s")}


def walk_of_lab(path: Path, lab: LabLog, number: int = 0) -> RecordedWalk:
    """Return the one walk of a CSV that was read already; `path` is for its title and messages. Raises LogError."""
    _refuse_number(path, number, 1 if lab.flippers else 0)
    start_s, estimator = float(lab.stamp_s[0]), lab_estimator(lab)
    loads: list[tuple[FlipperLoad, ...]] = []  # left and right, a row each
    rows: list[dict[str, Any]] = []
    noticed_s: list[float] = []
    for now_s, reading in lab_readings(estimator, lab):
        loads.append(reading.loads)
        own = [stride for stride in reading.strides if stride.flipper in lab.flippers]
        rows += [STRIDE.decode(stride_row(stride.t_end_s, stride, nan)) for stride in own]
        if reading.strides and estimator.mud_estimate.boundary:
            noticed_s.append(now_s - start_s)
    series: dict[str, dict[str, Any]] = {
        flipper: {
            "sweep_angle_rad": lab.angle_rad[:, 2 * place],
            "adduction_angle_rad": lab.angle_rad[:, 2 * place + 1],
            **{name: np.array([getattr(both[place], name) for both in loads]) for name in LOAD_COLUMNS},
        }
        for place, flipper in enumerate(FLIPPERS)
        if flipper in lab.flippers
    }
    return RecordedWalk(
        title=path.name,
        geometry=FlipperGeometry(),
        flipper=lab.flippers[-1],
        **series[lab.flippers[-1]],
        time_s=lab.stamp_s - start_s,
        phase=lab.phase,
        depth_command_m=lab.commanded_depth_m,
        body_x_m=lab.body_x_m,
        strides=[_since(start_s, row) for row in rows],
        noticed_s=noticed_s,
        findings=lab.findings,
        series=series,
        fixed_base=lab.fixed_base,
    )
